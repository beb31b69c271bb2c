"""Planners of motions on learned physics.

A folder a method, each with its problem, settings and result: `kinodynamic` (an RRT over wrenches), `lattice`
(ARA* for a robot that pushes a cart among obstacles). What methods share lies beside them: `collision` (outlines that
move together against a floor), `ompl_session` (seed, silence and budget of a search with OMPL).
"""
