"""Landmark association: an inexact global map of surfaces that are recognised from view to view.

Yeap, Hossain and others, Autonomous robot mapping by landmark association (2015).
"""
