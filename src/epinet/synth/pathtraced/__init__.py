"""Path-traced scenes of real models (extra `render`): a second validation set.

`python -m epinet.synth.pathtraced OUT` renders them with Mitsuba 3, resumably; no asset and no
image of theirs is part of this repository.
"""
