"""RatSLAM with experience mapping (Milford, Prasser and Wyeth, ACRA 2005).

Views of the laser or the camera (`local_views`) are associated with poses in a competitive
attractor network (`pose_cells`). A view and a pose together make an experience. Experiences are
joined by the odometer's measurements between them (`experiences`), and moved until they fit these
links (`correction`).
"""
