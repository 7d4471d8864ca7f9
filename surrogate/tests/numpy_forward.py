"""A weights file applied to an input with numpy alone, independently of the Rust code.

Usage: numpy_forward.py MODEL EXAMPLE. Prints the largest difference from the example's output.
"""
import json
import sys

import numpy as np
from safetensors import safe_open
from safetensors.numpy import load_file

model, example = load_file(sys.argv[1]), load_file(sys.argv[2])
with safe_open(sys.argv[1], framework="numpy") as file:
    config = json.loads(file.metadata()["surrogate"])["config"]
slope = config["leaky_slope"] if config["kind"] == "tgnns" else 0.0


def mlp(name, *inputs):
    x = np.concatenate(inputs, axis=1)
    for layer in range(config["hidden_layers"] + 1):
        if layer > 0:
            x = np.where(x > 0, x, slope * x)
        linear = f"{name}.linears.{layer}"
        x = x @ model[f"{linear}.weight"].astype(np.float64).T + model[f"{linear}.bias"]
    if f"{name}.norm.weight" in model:
        x = (x - x.mean(axis=1, keepdims=True)) / np.sqrt(x.var(axis=1, keepdims=True) + 1e-5)
        x = x * model[f"{name}.norm.weight"] + model[f"{name}.norm.bias"]
    return x


def frame(k):
    sender, receiver = (example[f"{end}{k}"].astype(int) for end in ("sender", "receiver"))
    return example[f"nodes{k}"], example[f"edges{k}"], sender, receiver


def pass_messages(name, nodes, edges, sender, receiver):
    messages = mlp(f"{name}.message", nodes[sender], nodes[receiver], edges)
    received = np.zeros_like(nodes)
    np.add.at(received, receiver, messages)
    return mlp(f"{name}.update", nodes, received), messages


def later_edges(edges, sender, receiver, previous):
    """`previous` maps (receiver, sender) to the message along that edge in the frame before."""
    states = mlp("edge_encoder_later", edges)
    if config["edge_message"]:
        for edge, pair in enumerate(zip(receiver, sender)):
            if pair in previous:
                states[edge] = mlp("edge_fusion", previous[pair][None], edges[edge][None])[0]
    return states


def tgnns():
    raw_nodes, raw_edges, sender, receiver = frame(0)
    nodes, edges = mlp("node_encoder_first", raw_nodes), mlp("edge_encoder_first", raw_edges)
    for k in range(config["frames"]):
        if k > 0:
            previous = dict(zip(zip(receiver, sender), edges))
            raw_nodes, raw_edges, sender, receiver = frame(k)
            nodes = mlp("node_fusion", nodes, mlp("node_encoder_later", raw_nodes))
            edges = later_edges(raw_edges, sender, receiver, previous)
        nodes, edges = pass_messages(f"frame_layers.{k}", nodes, edges, sender, receiver)
    for k in range(config["message_layers"]):
        nodes, edges = pass_messages(f"message_layers.{k}", nodes, edges, sender, receiver)
    return mlp("decoder", nodes)


def gns():
    raw_nodes, raw_edges, sender, receiver = frame(0)
    nodes, edges = mlp("node_encoder", raw_nodes), mlp("edge_encoder", raw_edges)
    for k in range(config["gns_layers"]):
        updated, messages = pass_messages(f"layers.{k}", nodes, edges, sender, receiver)
        nodes, edges = nodes + updated, edges + messages
    return mlp("decoder", nodes)


output = tgnns() if config["kind"] == "tgnns" else gns()
print(np.abs(output - example["output"]).max())
