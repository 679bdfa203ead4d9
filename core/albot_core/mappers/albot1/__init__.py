"""Albot1: an imprecise, incomplete perceptual map, and a network of the places in it.

Hossain, *How Albot1 computes its perceptual map*, PhD thesis, AUT 2014, after Yeap's theory of
perceptual mapping (2011). `Albot1()` is the mapper `albot1`, which localises the robot by more
landmarks than the thesis does; `Albot1Config.thesis()` follows the thesis to the letter.

- `perceptual_map.mapping`: algorithms 1 to 4, from top to bottom; the other files beside it are
  ours,
- `places.network`: algorithms 5 and 7, `places.recognition`: algorithms 6 and 8,
- `trail`: breadcrumbs, and the shortest path home over them,
- `step`: the compiled loop over many robots, `handle_events`: the rare events of a step,
- `config`: every threshold, `state`: saving and restoring, `addresses`: where compiled code finds
  each robot's arrays,
  `batch`: many robots, `mapper`: a single robot; both are for users.
"""
