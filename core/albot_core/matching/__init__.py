"""Matching of places and of scans: whether two are the same, and their relative pose.

- `line_matching`: places by line segments; `line_pairs`: lines that match at a pose; `lines`:
  their rows; `line_merging`: merging of matching lines; `least_squares`: alignment of lines,
- `submaps`, `submap_kernels`: places by local submaps: lines propose poses, scans decide,
- `panorama`: places by the distances to obstacles around a point, in all directions,
- `correlation`: the best pose of a scan in a window, exactly; `likelihood_field`: the field in
  which it is searched; `scan_points`: its points; `refinement`: the pose below a cell.
"""
