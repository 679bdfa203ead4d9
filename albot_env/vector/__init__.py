"""Many environments at once, in gymnasium's and in stable-baselines3's form."""
