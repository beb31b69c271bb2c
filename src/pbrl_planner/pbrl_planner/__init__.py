"""Planners of motions on learned physics.

A folder a method, each with its problem, settings and result: `kinodynamic` (an RRT over wrenches). What methods
share lies beside them: `collision` (outlines that move together against a floor), `ompl_session` (seed, silence and
budget of a search with OMPL).
"""
