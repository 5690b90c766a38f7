"""What the viewer shows of a presentation: a summary, plots, events and a scene, laid out as a blueprint.

Everything that is there to be looked at only stands below /shown; the data of a result stand where its
fields are. Data goes one way: presentation -> `plots`, `events`, `summary`, `scene_drawing` -> `blueprint`.
"""
