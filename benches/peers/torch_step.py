"""One training step of Phy-Ture in PyTorch, timed: the network of src/nn/phyture.rs, layer by layer as its modules come.

Prints one JSON line. Not a library: the script `run.py` beside it starts this in a process of its own for each row.

    torch_step.py CASE THREADS BATCH HISTORY REPEATS

CASE is attention-dropout, with attention `naive` (the stored map), `fused` (scaled_dot_product_attention), `compile` (fused, under
torch.compile) or `expert` (byte masks drawn once a step, attention recomputed in the backward pass), and dropout `0.2` or `0`;
`forward-ATTENTION` for inference; or `peer-KIND` for a training step of a peer network without dropout.
"""

import functools
import importlib.util
import json
import math
import pathlib
import resource
import sys
import time

import torch
from torch import nn
from torch.nn import functional as F
from torch.utils.checkpoint import checkpoint

WIDTH, HEADS, STATES, PHYSICS, OUTPUTS = 64, 4, 16, 6, 6
LEVELS, STACKS, AVERAGE, KERNEL1, KERNEL2, LEAK = 3, 2, 25, 5, 3, 0.01

# Default sizes of the peers, src/nn/peers/*.rs.
PEERS = {
    "cnn": {"channels": [32, 64, 64, 128], "kernels": [7, 5, 3, 3], "hidden": 128},
    "cnn_lstm": {"channels": [64, 64], "kernels": [5, 3], "pool": 2, "hidden": 64},
    "tcn": {"channels": 30, "kernel": 7, "levels": 8},
    "timesnet": {"d_model": 32, "d_ff": 32, "periods": 5, "kernels": 6, "layers": 2},
    "timemixer": {"d_model": 16, "d_ff": 32, "layers": 2, "scales": 3, "moving_average": 25},
    "dlinear": {"moving_average": 25, "individual": False},
    "informer": {"d_model": 64, "d_ff": 256, "heads": 4, "encoder_layers": 2, "decoder_layers": 1, "decoder_rows": 48, "factor": 5},
}


class ByteDropout(torch.autograd.Function):
    """Dropout whose mask is one byte a number, drawn as random bytes: what an expert writes in the place of F.dropout."""

    @staticmethod
    def forward(context, x, rate):
        keep = torch.randint(0, 256, x.shape, dtype=torch.uint8) >= round(256 * rate)
        context.save_for_backward(keep)
        context.scale = 1.0 / (1.0 - round(256 * rate) / 256)
        return x * keep * context.scale

    @staticmethod
    def backward(context, dy):
        (keep,) = context.saved_tensors
        return dy * keep * context.scale, None


def drop(x, rate, expert, training):
    if not training or rate == 0.0:
        return x
    return ByteDropout.apply(x, rate) if expert else F.dropout(x, rate)


class Module(nn.Module):
    def __init__(self, rate, expert):
        super().__init__()
        pad = KERNEL1 + KERNEL2 - 2
        self.pad, self.rate, self.expert = nn.ReplicationPad1d((pad // 2, pad - pad // 2)), rate, expert
        self.conv1, self.conv2 = nn.Conv1d(WIDTH, WIDTH, KERNEL1), nn.Conv1d(WIDTH, WIDTH, KERNEL2)

    def forward(self, x):
        x = F.leaky_relu(self.conv1(self.pad(x)), LEAK)
        return torch.tanh(self.conv2(drop(x, self.rate, self.expert, self.training)))


class Tree(nn.Module):
    def __init__(self, level, rate, expert):
        super().__init__()
        self.phi, self.psi, self.rho, self.eta = (Module(rate, expert) for _ in range(4))
        self.even = Tree(level - 1, rate, expert) if level > 1 else None
        self.odd = Tree(level - 1, rate, expert) if level > 1 else None

    def forward(self, x):
        even, odd = x[:, :, ::2], x[:, :, 1::2]
        odd, even = odd * torch.exp(self.phi(even)), even * torch.exp(self.psi(odd))
        even, odd = even + self.eta(odd), odd + self.rho(even)
        if self.even is not None:
            even, odd = self.even(even), self.odd(odd)
        return torch.stack((even, odd), dim=3).flatten(2)


class PhyTure(nn.Module):
    def __init__(self, history, rate, attention):
        super().__init__()
        self.rate, self.attention = rate, attention
        expert = attention == "expert"
        self.state, self.physics = nn.Linear(STATES, WIDTH), nn.Linear(PHYSICS, WIDTH)
        self.query, self.key, self.value, self.output = (nn.Linear(WIDTH, WIDTH) for _ in range(4))
        self.norm = nn.LayerNorm(WIDTH)
        self.trees = nn.ModuleList(Tree(LEVELS, rate, expert) for _ in range(STACKS))
        self.trend, self.seasonal, self.head = nn.Linear(history, 1), nn.Linear(history, 1), nn.Linear(WIDTH, OUTPUTS)
        position = torch.arange(history)[:, None] * torch.exp(torch.arange(0, WIDTH, 2) * (-math.log(10000.0) / WIDTH))
        self.register_buffer("encoding", torch.stack((position.sin(), position.cos()), dim=2).flatten(1))

    def heads(self, x):
        return x.unflatten(2, (HEADS, WIDTH // HEADS)).transpose(1, 2)

    def attend(self, query, key, value):
        if self.attention in ("fused", "compile"):
            return F.scaled_dot_product_attention(query, key, value, dropout_p=self.rate if self.training else 0.0)
        scores = torch.softmax(query @ key.transpose(2, 3) / math.sqrt(WIDTH // HEADS), dim=3)
        return drop(scores, self.rate, self.attention == "expert", self.training) @ value

    def forward(self, state, physics):
        state, physics = self.state(state) + self.encoding, self.physics(physics) + self.encoding
        parts = self.heads(self.query(state)), self.heads(self.key(physics)), self.heads(self.value(physics))
        if self.attention == "expert" and self.training:
            mixed = checkpoint(self.attend, *parts, use_reentrant=False)
        else:
            mixed = self.attend(*parts)
        x = self.norm(self.output(mixed.transpose(1, 2).flatten(2)) + state).transpose(1, 2)
        for tree in self.trees:
            x = x + tree(x)
        half = (AVERAGE - 1) // 2
        trend = F.avg_pool1d(F.pad(x, (half, half), mode="replicate"), AVERAGE, stride=1)
        return self.head((self.trend(trend) + self.seasonal(x - trend)).transpose(1, 2))


class Peer(nn.Module):
    """A peer network as the golden files' script writes it with PyTorch's own operators, in f32, at its default sizes, without dropout."""

    def __init__(self, kind, history):
        super().__init__()
        path = pathlib.Path(__file__).resolve().parents[2] / "fixtures" / "peers" / "generate.py"
        spec = importlib.util.spec_from_file_location("golden", path)
        golden = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(golden)
        # Positions are the same in every step.
        positions = functools.cache(golden.positions)
        self.network, self.weights = golden.NETWORKS[kind][0], golden.Weights()
        self.config = {"history": history, "state_channels": STATES, **PEERS[kind]}
        self.network(self.config, torch.zeros(1, history, STATES, dtype=torch.float64), self.weights)
        golden.positions = lambda rows, channels: single(rows, channels)
        single = functools.cache(lambda rows, channels: positions(rows, channels).float())
        self.weights.tensors = {name: nn.Parameter(value.detach().float()) for name, value in self.weights.tensors.items()}
        self.values = nn.ParameterList(self.weights.tensors.values())

    def forward(self, state, _):
        return self.network(self.config, state, self.weights)[:, None, :]


def main():
    case, threads, batch, history, repeats = sys.argv[1], *map(int, sys.argv[2:6])
    torch.set_num_threads(threads)
    torch.manual_seed(0)
    first, second = case.split("-")
    training = first != "forward"
    if first == "peer":
        network = Peer(second, history)
        attention = "peer"
    else:
        attention, rate = (first, float(second)) if training else (second, 0.0)
        network = PhyTure(history, rate, attention).train(training)
    run = torch.compile(network) if attention == "compile" else network
    adam = torch.optim.Adam(network.parameters(), lr=1e-3)
    state, physics = torch.rand(batch, history, STATES) * 2 - 1, torch.rand(batch, history, PHYSICS) * 2 - 1
    target = torch.rand(batch, 1, OUTPUTS) * 2 - 1

    def step():
        if not training:
            with torch.no_grad():
                return run(state, physics)
        loss = ((run(state, physics) - target) ** 2).sum(dim=2).mean()
        adam.zero_grad()
        loss.backward()
        adam.step()
        return loss

    for _ in range(2):
        step()
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        step()
        seconds.append(time.perf_counter() - start)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    parameters = sum(parameter.numel() for parameter in network.parameters())
    print(json.dumps({"seconds": seconds, "peak_mib": peak, "parameters": parameters, "version": f"PyTorch {torch.__version__}"}))


if __name__ == "__main__":
    main()
