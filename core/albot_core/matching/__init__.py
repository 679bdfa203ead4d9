"""Place matching: whether two places are the same, and where one lies in the other.

- `lines`: by line segments; `least_squares`: the alignment of matched ones,
- `submaps`, `submap_kernels`: by local submaps, whose lines propose and whose scans decide,
- `panorama`: by the distance to what stands around a point, in all directions.
"""
