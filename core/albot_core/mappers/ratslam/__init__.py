"""RatSLAM with experience mapping (Milford, Prasser and Wyeth, ACRA 2005).

Views of the laser or the camera (`local_views`) are associated with poses in a competitive
attractor network (`pose_cells`). Both together make experiences, which are joined by what the
odometer measured between them (`experiences`) and moved until these links fit (`correction`).
"""
