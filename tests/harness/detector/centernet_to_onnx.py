"""CenterNet as TensorFlow.js has it (centernet.json and centernet.bin of npm's @vladmandic/human) to ONNX.

    python centernet_to_onnx.py FOLDER MODEL.onnx

Input `image` [1, 3, 512, 512], red, green and blue from 0 to 255. Outputs `heat` [1, 80, 128, 128], scores of COCO's classes,
and `wh` [1, 4, 128, 128], how many pixels of the input the left, top, right and lower edge are from a cell's corner.
"""
import base64
import json
import pathlib
import sys

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

TYPES = {"float16": np.float16, "float32": np.float32, "int32": np.int32}


def weights(manifest, data):
    """Arrays by name; what is stored in half precision becomes single precision."""
    arrays, at = {}, 0
    for entry in manifest:
        stored = TYPES[entry.get("quantization", {}).get("dtype", entry["dtype"])]
        count = int(np.prod(entry["shape"]))
        array = np.frombuffer(data, stored, count, at).reshape(entry["shape"])
        at += count * np.dtype(stored).itemsize
        arrays[entry["name"]] = array.astype(np.float32) if stored is np.float16 else array
    if at != len(data):
        sys.exit(f"the weights are {len(data)} bytes, and {at} are told")
    return arrays


def text(value):
    return base64.b64decode(value).decode()


class Graph:
    """Nodes of ONNX, made one after the other as the last one asks for its inputs. Axes: batch, channel, row, column."""

    def __init__(self, topology, arrays):
        self.source = {node["name"]: node for node in topology["node"]}
        self.arrays, self.made, self.nodes, self.constants = arrays, {}, [], []

    def constant(self, array):
        name = f"constant_{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(array), name))
        return name

    def add(self, operator, inputs, **attributes):
        name = f"{operator}_{len(self.nodes)}"
        self.nodes.append(helper.make_node(operator, inputs, [name], **attributes))
        return name

    def array(self, reference):
        return self.arrays[reference.lstrip("^").split(":")[0]]

    def get(self, reference):
        name = reference.lstrip("^").split(":")[0]
        if name not in self.made:
            self.made[name] = self.make(self.source[name])
        return self.made[name]

    def make(self, node):
        operator, inputs, attributes = node["op"], node.get("input", []), node.get("attr", {})

        def sides(key):
            return [int(v) for v in attributes[key]["list"]["i"]][1:3]

        def bounded(x):
            return self.add("Clip", [x, self.constant(np.float32(0)), self.constant(np.float32(6))])

        if operator == "Placeholder":
            return "image"
        if operator == "Const":
            # all that reach the outputs are numbers, not arrays
            return self.constant(self.array(node["name"]).astype(np.float32).reshape(()))
        if operator == "Identity":
            return self.get(inputs[0])
        if operator in ("_FusedConv2D", "Conv2D", "FusedDepthwiseConv2dNative", "DepthwiseConv2dNative"):
            array = self.array(inputs[1])
            rows, columns, channels, outputs = array.shape
            if "Depthwise" in operator:
                kernel, groups = array.transpose(2, 3, 0, 1).reshape(channels * outputs, 1, rows, columns), channels
            else:
                kernel, groups = array.transpose(3, 2, 0, 1), 1
            fused = [text(s) for s in attributes.get("fused_ops", {}).get("list", {}).get("s", [])]
            bias = [self.constant(self.array(inputs[2]))] if "BiasAdd" in fused else []
            padding = "SAME_UPPER" if text(attributes["padding"]["s"]) == "SAME" else "VALID"
            x = self.add("Conv", [self.get(inputs[0]), self.constant(kernel), *bias], strides=sides("strides"), group=groups, auto_pad=padding)
            for operation in fused:
                if operation == "Relu6":
                    x = bounded(x)
                elif operation == "Relu":
                    x = self.add("Relu", [x])
                elif operation not in ("BiasAdd", "NoOp"):
                    sys.exit(f"{node['name']}: unknown operation {operation}")
            return x
        if operator in ("Add", "AddV2", "Mul", "Sub"):
            return self.add(operator.removesuffix("V2"), [self.get(i) for i in inputs])
        if operator == "Relu6":
            return bounded(self.get(inputs[0]))
        if operator in ("Relu", "Sigmoid"):
            return self.add(operator, [self.get(inputs[0])])
        if operator == "Mean":
            return self.add("ReduceMean", [self.get(inputs[0])], axes=[2, 3], keepdims=1)
        if operator == "ConcatV2":
            return self.add("Concat", [self.get(i) for i in inputs[:-1]], axis=1)
        if operator == "ResizeBilinear":
            twice = self.constant(np.array([1, 1, 2, 2], np.float32))
            return self.add("Resize", [self.get(inputs[0]), "", twice], mode="linear", coordinate_transformation_mode="asymmetric")
        if operator == "MaxPool":
            return self.add("MaxPool", [self.get(inputs[0])], kernel_shape=sides("ksize"), strides=sides("strides"), auto_pad="SAME_UPPER")
        sys.exit(f"{node['name']}: unknown operator {operator}")


def main(folder, target):
    folder = pathlib.Path(folder)
    source = json.loads((folder / "centernet.json").read_text())
    arrays = weights(source["weightsManifest"][0]["weights"], (folder / "centernet.bin").read_bytes())
    graph = Graph(source["modelTopology"], arrays)
    sys.setrecursionlimit(10_000)
    for name, wanted in (("heat", "tower_0/keypoints"), ("wh", "tower_0/wh")):
        graph.nodes.append(helper.make_node("Identity", [graph.get(wanted)], [name]))
    tensor = lambda name, shape: helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)
    inputs = [tensor("image", [1, 3, 512, 512])]
    outputs = [tensor("heat", [1, 80, 128, 128]), tensor("wh", [1, 4, 128, 128])]
    made = helper.make_graph(graph.nodes, "centernet", inputs, outputs, graph.constants)
    model = helper.make_model(made, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    onnx.checker.check_model(model)
    onnx.save(model, target)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
