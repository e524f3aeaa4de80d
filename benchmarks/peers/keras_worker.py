"""The reference's architecture in Keras, run by a Python that has TensorFlow but not epinet.

    python keras_worker.py WEIGHTS.h5 STACKS.npy MAP.npy THREADS REPEATS

Written after the reference implementation's `define_epinet` (MIT): its layers, their names and its
HDF5 files. STACKS.npy is (4, N, H, W); MAP.npy becomes (H - 22, W - 22). Prints the times.
"""

import json
import os
import sys

os.environ["TF_CPP_MIN_LOG_LEVEL"] = "3"

import keras
import numpy as np
import tensorflow as tf
from keras.layers import Activation, BatchNormalization, Concatenate, Conv2D, Input
from measurements import measured  # beside this file


def blocks(part: str, count: int, channels_in: int, channels: int) -> keras.Model:
    """`count` times conv - ReLU - conv - BN - ReLU."""
    layers = [Input((None, None, channels_in))]
    for i in range(count):
        layers += [
            Conv2D(channels, 2, padding="valid", name=f"{part}_c1{i}"),
            Activation("relu", name=f"{part}_relu1{i}"),
            Conv2D(channels, 2, padding="valid", name=f"{part}_c2{i}"),
            BatchNormalization(name=f"{part}_BN{i}"),
            Activation("relu", name=f"{part}_relu2{i}"),
        ]
    return keras.Sequential(layers)


def define_epinet(views: int, width: int) -> keras.Model:
    stacks = [Input((None, None, views)) for _ in range(4)]
    merged = Concatenate()([blocks("S1", 3, views, width)(stack) for stack in stacks])
    merged = blocks("S2", 7, 4 * width, 4 * width)(merged)
    end = keras.Sequential(
        [
            Input((None, None, 4 * width)),
            Conv2D(4 * width, 2, padding="valid", name="S3_c10"),
            Activation("relu", name="S3_relu10"),
            Conv2D(1, 2, padding="valid", name="S3_last"),
        ]
    )
    return keras.Model(stacks, end(merged))


def main() -> None:
    weights, stacks_file, output, threads, repeats = sys.argv[1:]
    tf.config.threading.set_intra_op_parallelism_threads(int(threads))
    tf.config.threading.set_inter_op_parallelism_threads(1)
    stacks = np.load(stacks_file)
    model = define_epinet(stacks.shape[1], width=70)
    model.load_weights(weights)
    inputs = [np.ascontiguousarray(stack.transpose(1, 2, 0)[None]) for stack in stacks]
    disparity, costs = measured(
        lambda: model.predict(inputs, batch_size=1, verbose=0), int(repeats)
    )
    np.save(output, disparity[0, ..., 0])
    versions = {"keras": keras.__version__, "tensorflow": tf.__version__}
    print(json.dumps(costs | {"versions": versions}))


if __name__ == "__main__":
    main()
