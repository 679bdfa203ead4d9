"""The network of places (chapter 4 of the thesis).

- `exits`: exits in view, exits remembered, and when one is crossed,
- `visits`: the visit in which each surface was seen, and which visits are loop-closure candidates,
- `place`: a place and its exits, `network`: places and the exits between them (algorithms 5, 7),
- `merging`: merging two places that are found to be one,
- `recognition`: whether the present place is a known one (algorithms 6, 8),
- `events`: what happened to the network, and why,
- `wayfinding`: the way to a place over the network, and the way home.
"""
