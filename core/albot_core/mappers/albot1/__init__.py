"""Albot1: an imprecise, incomplete perceptual map from landmarks in view.

Hossain, *How Albot1 computes its perceptual map*, PhD thesis, AUT 2014, after Yeap's
theory of perceptual mapping (2011). One file a step of its algorithm 4:

- `recognition`: which landmarks of the last view are in this one (algorithm 1),
- `localization`: where the robot is in its map (algorithm 2),
- `updating`: laying a view over the map (algorithm 3),
- `mapping`: one view through the whole (algorithm 4),
- `turning`, `outlook`, `triangulation`: what `albot1` does in place of algorithms 1 and 2,
- `memory`: the perceptual map itself, `config`: every threshold,
- `following`: readings as they come, for many robots; `storage`: where each one's arrays are,
- `batch`: many robots, `mapper`: a single one, as users hold them.
"""
