"""Breadcrumbs: where the robot has been, and the shortest path home over them.

- `breadcrumbs`: points of the robot's past path, and the way home along them,
- `crumb_kernels`: dropping a breadcrumb, and which breadcrumbs are within straight reach,
- `path_tree`: the tree of shortest paths home, kept up to date link by link.
"""
