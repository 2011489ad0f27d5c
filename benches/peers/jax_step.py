"""One training step of Phy-Ture in JAX under jit, timed; the same network as torch_step.py. Prints one JSON line.

    jax_step.py CASE THREADS BATCH HISTORY REPEATS

CASE is the dropout rate, `0.2` or `0`, or `forward`. The generator is `rbg`, JAX's fastest on a processor.
"""

import json
import math
import os
import resource
import sys
import time

CASE, THREADS, BATCH, HISTORY, REPEATS = sys.argv[1], *map(int, sys.argv[2:6])
os.environ["XLA_FLAGS"] = f"--xla_cpu_multi_thread_eigen={'true' if THREADS > 1 else 'false'} intra_op_parallelism_threads={THREADS}"
os.sched_setaffinity(0, set(sorted(os.sched_getaffinity(0))[:THREADS]))

import jax
import jax.numpy as jnp
from jax import lax

jax.config.update("jax_default_prng_impl", "rbg")
WIDTH, HEADS, STATES, PHYSICS, OUTPUTS = 64, 4, 16, 6, 6
LEVELS, STACKS, AVERAGE, KERNEL1, KERNEL2, LEAK = 3, 2, 25, 5, 3, 0.01
RATE = 0.0 if CASE == "forward" else float(CASE)


def linear(key, inputs, outputs):
    bound = 1 / math.sqrt(inputs)
    return jax.random.uniform(key, (inputs, outputs), minval=-bound, maxval=bound), jnp.zeros(outputs)


def convolution(key, taps):
    bound = 1 / math.sqrt(taps * WIDTH)
    return jax.random.uniform(key, (taps, WIDTH, WIDTH), minval=-bound, maxval=bound), jnp.zeros(WIDTH)


def parameters(key):
    keys = iter(jax.random.split(key, 300))
    names = ("phi", "psi", "rho", "eta")
    block = lambda: {name: (convolution(next(keys), KERNEL1), convolution(next(keys), KERNEL2)) for name in names}
    tree = lambda: [block() for _ in range(2**LEVELS - 1)]
    return {
        "state": linear(next(keys), STATES, WIDTH), "physics": linear(next(keys), PHYSICS, WIDTH),
        **{name: linear(next(keys), WIDTH, WIDTH) for name in ("query", "key", "value", "output")},
        "norm": (jnp.ones(WIDTH), jnp.zeros(WIDTH)), "trees": [tree() for _ in range(STACKS)],
        "trend": linear(next(keys), HISTORY, 1), "seasonal": linear(next(keys), HISTORY, 1), "head": linear(next(keys), WIDTH, OUTPUTS),
    }


def apply(layer, x):
    return x @ layer[0] + layer[1]


def convolve(layer, x):
    return lax.conv_general_dilated(x, layer[0], (1,), "VALID", dimension_numbers=("NWC", "WIO", "NWC")) + layer[1]


def drop(x, keys):
    if RATE == 0.0:
        return x
    return jnp.where(jax.random.bernoulli(next(keys), 1 - RATE, x.shape), x / (1 - RATE), 0.0)


def module(layers, x, keys):
    pad = KERNEL1 + KERNEL2 - 2
    x = jnp.pad(x, ((0, 0), (pad // 2, pad - pad // 2), (0, 0)), mode="edge")
    return jnp.tanh(convolve(layers[1], drop(jax.nn.leaky_relu(convolve(layers[0], x), LEAK), keys)))


def tree(blocks, x, keys, index=0):
    even, odd, block = x[:, ::2], x[:, 1::2], blocks[index]
    odd, even = odd * jnp.exp(module(block["phi"], even, keys)), even * jnp.exp(module(block["psi"], odd, keys))
    even, odd = even + module(block["eta"], odd, keys), odd + module(block["rho"], even, keys)
    if 2 * index + 2 < len(blocks):
        even, odd = tree(blocks, even, keys, 2 * index + 1), tree(blocks, odd, keys, 2 * index + 2)
    return jnp.stack((even, odd), axis=2).reshape(x.shape)


def forward(p, state, physics, key):
    keys = iter(jax.random.split(key, 100))
    position = jnp.arange(HISTORY)[:, None] * jnp.exp(jnp.arange(0, WIDTH, 2) * (-math.log(10000.0) / WIDTH))
    encoding = jnp.stack((jnp.sin(position), jnp.cos(position)), axis=2).reshape(HISTORY, WIDTH)
    state, physics = apply(p["state"], state) + encoding, apply(p["physics"], physics) + encoding
    heads = lambda x: x.reshape(x.shape[0], HISTORY, HEADS, WIDTH // HEADS)
    query, key_, value = heads(apply(p["query"], state)), heads(apply(p["key"], physics)), heads(apply(p["value"], physics))
    scores = jax.nn.softmax(jnp.einsum("bihc,bjhc->bhij", query, key_) / math.sqrt(WIDTH // HEADS))
    mixed = jnp.einsum("bhij,bjhc->bihc", drop(scores, keys), value).reshape(state.shape)
    x = apply(p["output"], mixed) + state
    x = (x - x.mean(-1, keepdims=True)) * lax.rsqrt(x.var(-1, keepdims=True) + 1e-5) * p["norm"][0] + p["norm"][1]
    for blocks in p["trees"]:
        x = x + tree(blocks, x, keys)
    half = (AVERAGE - 1) // 2
    padded = jnp.pad(x, ((0, 0), (half, half), (0, 0)), mode="edge")
    trend = lax.reduce_window(padded, 0.0, lax.add, (1, AVERAGE, 1), (1, 1, 1), "VALID") / AVERAGE
    row = apply(p["trend"], trend.swapaxes(1, 2)) + apply(p["seasonal"], (x - trend).swapaxes(1, 2))
    return apply(p["head"], row.swapaxes(1, 2))


def loss(p, state, physics, target, key):
    return ((forward(p, state, physics, key) - target) ** 2).sum(axis=2).mean()


@jax.jit
def train(p, first, second, step, state, physics, target, key):
    value, gradient = jax.value_and_grad(loss)(p, state, physics, target, key)
    first = jax.tree.map(lambda m, g: 0.9 * m + 0.1 * g, first, gradient)
    second = jax.tree.map(lambda v, g: 0.999 * v + 0.001 * g * g, second, gradient)
    scale = lambda m, v: m / (1 - 0.9**step) / (jnp.sqrt(v / (1 - 0.999**step)) + 1e-8)
    p = jax.tree.map(lambda x, m, v: x - 1e-3 * scale(m, v), p, first, second)
    return p, first, second, value


def main():
    key = jax.random.key(0)
    p = parameters(key)
    state = jax.random.uniform(key, (BATCH, HISTORY, STATES), minval=-1.0)
    physics = jax.random.uniform(key, (BATCH, HISTORY, PHYSICS), minval=-1.0)
    target = jax.random.uniform(key, (BATCH, 1, OUTPUTS), minval=-1.0)
    first = second = jax.tree.map(jnp.zeros_like, p)
    infer = jax.jit(forward)
    seconds = []
    for step in range(2 + REPEATS):
        start = time.perf_counter()
        if CASE == "forward":
            infer(p, state, physics, key).block_until_ready()
        else:
            p, first, second, value = train(p, first, second, step + 1.0, state, physics, target, jax.random.fold_in(key, step))
            value.block_until_ready()
        seconds.append(time.perf_counter() - start)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    count = sum(x.size for x in jax.tree.leaves(p))
    print(json.dumps({"seconds": seconds[2:], "peak_mib": peak, "parameters": count, "version": f"JAX {jax.__version__}"}))


if __name__ == "__main__":
    main()
