"""Matching of places and of scans: whether two are the same, and where one lies in the other.

- `line_matching`: by line segments; `line_pairs`: which are the same under a pose; `lines`: their
  rows; `line_merging`: one line for several; `least_squares`: the alignment of matched lines,
- `submaps`, `submap_kernels`: by local submaps: lines propose poses, scans decide,
- `panorama`: by the distances to obstacles around a point, in all directions,
- `correlation`: the pose of a scan in a window, exactly; `likelihood_field`: what it is looked up
  in; `scan_points`: its points; `refinement`: the pose below a cell.
"""
