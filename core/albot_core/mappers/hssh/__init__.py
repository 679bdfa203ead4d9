"""The Hybrid Spatial Semantic Hierarchy: local maps, gateways, stars, and the tree of their maps.

P. Beeson, J. Modayil and B. Kuipers, Factoring the mapping problem: mobile robot map-building in
the hybrid spatial semantic hierarchy, IJRR 2010, as far as Hossain 2014 (section 2.3.3) gives it.
"""
