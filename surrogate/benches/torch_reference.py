"""The Baseline in PyTorch, as graph libraries compute it (gather, concatenate, MLP, index_add), on
what examples/network_bench.rs left: compares output and gradient, and times a training step.

python torch_reference.py FOLDER [--quick]     (needs torch and safetensors, and a GPU)
"""

import json
import sys
import time

import torch
from safetensors import safe_open
from torch import nn
from torch.nn import functional as F


class Mlp(nn.Module):
    def __init__(self, inputs, outputs, layers=2, width=128, norm=True):
        super().__init__()
        sizes = [inputs] + [width] * layers + [outputs]
        self.linears = nn.ModuleList(nn.Linear(a, b) for a, b in zip(sizes, sizes[1:]))
        self.norm = nn.LayerNorm(outputs) if norm else nn.Identity()

    def forward(self, x):
        for linear in self.linears[:-1]:
            x = F.leaky_relu(linear(x), 0.1)
        return self.norm(self.linears[-1](x))


class Layer(nn.Module):
    def __init__(self):
        super().__init__()
        self.message, self.update = Mlp(384, 128), Mlp(256, 128)

    def forward(self, nodes, edges, sender, receiver):
        m = self.message(torch.cat([nodes[sender], nodes[receiver], edges], 1))
        received = torch.zeros_like(nodes, dtype=m.dtype).index_add_(0, receiver, m)
        return self.update(torch.cat([nodes.to(m.dtype), received], 1)), m


class Tgnns(nn.Module):
    def __init__(self, frames=6, messages=2, d=2):
        super().__init__()
        self.node_encoder_first, self.node_encoder_later = Mlp(2 * d, 128), Mlp(3 * d, 128)
        self.edge_encoder_first, self.edge_encoder_later = Mlp(d + 1, 128), Mlp(2 * d + 1, 128)
        self.node_fusion = Mlp(256, 128)
        self.frame_layers = nn.ModuleList(Layer() for _ in range(frames))
        self.message_layers = nn.ModuleList(Layer() for _ in range(messages))
        self.decoder = Mlp(128, d, norm=False)

    def forward(self, frames):
        for k, (node, edge, sender, receiver) in enumerate(frames):
            if k == 0:
                nodes, edges = self.node_encoder_first(node), self.edge_encoder_first(edge)
            else:
                nodes = self.node_fusion(torch.cat([nodes, self.node_encoder_later(node)], 1))
                edges = self.edge_encoder_later(edge)
            nodes, edges = self.frame_layers[k](nodes, edges, sender, receiver)
        for layer in self.message_layers:
            nodes, edges = layer(nodes, edges, sender, receiver)
        return self.decoder(nodes)


def relative(a, b):
    return ((a - b).double().norm() / b.double().norm()).item()


def main(folder, quick):
    torch.backends.cuda.matmul.allow_tf32 = False
    data = safe_open(f"{folder}/bench.safetensors", "pt", device="cuda")
    names = ("node", "edge", "sender", "receiver")
    frames = [tuple(data.get_tensor(f"{n}{k}") for n in names) for k in range(6)]
    target = data.get_tensor("target")
    weights = safe_open(f"{folder}/weights.safetensors", "pt", device="cuda")
    assert json.loads(weights.metadata()["surrogate"])["config"]["width"] == 128
    model = Tgnns().cuda()
    mine = {k: weights.get_tensor(k) for k in weights.keys() if not k.startswith("normalisation")}
    model.load_state_dict(mine)

    # The order of the gradients: fields in order, matrices transposed.
    def gradient():
        parts = []
        for p in model.parameters():
            parts.append((p.grad.T if p.ndim == 2 else p.grad).reshape(-1))
        return torch.cat(parts)

    def loss_of(net, kind):
        with torch.autocast("cuda", torch.bfloat16, enabled=kind == "bf16"):
            output = net(frames)
        return ((output.float() - target) ** 2).sum() / (target**2).sum(), output

    for kind in ("f32", "bf16"):
        model.zero_grad()
        loss, output = loss_of(model, kind)
        loss.backward()
        if kind == "f32":
            exact, exact_gradient = output.detach().clone(), gradient()
            for ours in ("f32", "bf16"):
                a, b = data.get_tensor(f"output_{ours}"), data.get_tensor(f"gradient_{ours}")
                print(f"ours {ours}, from PyTorch f32: output {relative(a, exact):.1e}, "
                      f"gradient {relative(b, exact_gradient):.1e}")
        else:
            print(f"PyTorch bf16, from PyTorch f32: output {relative(output.float(), exact):.1e}, "
                  f"gradient {relative(gradient(), exact_gradient):.1e}")

    compiled = torch.compile(model)
    variants = [("eager f32", model, "f32"), ("eager bf16", model, "bf16"),
                ("torch.compile bf16", compiled, "bf16")]
    for name, net, kind in variants[: 2 if quick else 3]:
        optimiser = torch.optim.Adam(model.parameters(), 1e-6, fused=True)

        def step():
            optimiser.zero_grad(set_to_none=True)
            loss_of(net, kind)[0].backward()
            optimiser.step()

        def frame():
            with torch.no_grad():
                loss_of(net, kind)

        for what, work in (("training step", step), ("forward pass", frame)):
            began = time.time()
            for _ in range(3):
                work()
            torch.cuda.synchronize()
            warm = time.time() - began
            times = []
            for _ in range(5):
                began = time.time()
                for _ in range(10):
                    work()
                torch.cuda.synchronize()
                times.append(100 * (time.time() - began))
            print(f"PyTorch {name}: {what} of the batch {sorted(times)[2]:.2f} ms "
                  f"(first three calls {warm:.0f} s)", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], "--quick" in sys.argv)
