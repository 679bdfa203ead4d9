"""Breadcrumbs: where the robot has been, and the shortest path home over it.

- `breadcrumbs`: the points that a robot has come through, and the way home along them,
- `crumb_kernels`: dropping a breadcrumb, and which of them are within straight reach,
- `path_tree`: the tree of shortest paths home, kept up to date link by link.
"""
