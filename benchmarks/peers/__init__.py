"""What else a user would pick, on the same light fields: `python -m benchmarks.peers`.

    structure_tensor   orientation of lines in epipolar images, total variation
    plane_sweep        cost volume, guided filter
    keras              the reference architecture in Keras, which installs itself beside the package

Parameters are published ones, or were chosen on rendered scenes; none on the scenes measured on.
"""
