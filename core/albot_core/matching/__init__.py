"""Place matching: whether two places are the same, and where one lies in the other.

- `lines`: by line segments; `least_squares`: the alignment of matched lines,
- `submaps`, `submap_kernels`: by local submaps: lines propose poses, scans decide,
- `panorama`: by the distances to obstacles around a point, in all directions.
"""
