"""One row of the latency of other programs: a forward pass of Phy-Ture on one window, called at 100 Hz in real time. Prints one JSON line.

    other.py CASE HISTORY WIDTH LEVELS SECONDS FOLDER

CASE is `naive`, `fused` or `compile` for PyTorch (the network of benches/peers/torch_step.py), `onnx` for ONNX Runtime on what PyTorch exports. Weights
and window are those that this project's own row has left in FOLDER; what comes out has to be what it says there, or the row fails. Started by `run.py`
beside it.
"""

import io
import json
import pathlib
import re
import sys
import time

import torch
from safetensors.torch import load_file

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "peers"))
import torch_step  # noqa: E402

# Largest difference of an output from this project's, over the largest output: rounding in f32, through some fifty layers.
LARGEST_DIFFERENCE = 1e-3


def name_here(name):
    """What torch_step.py calls a parameter of the exchange with PyTorch."""
    tree = re.fullmatch(r"mstfe\.(\d+)\.(root|[eo]+)\.(.+)", name)
    if tree:
        stack, node, rest = tree.groups()
        way = [] if node == "root" else [{"e": "even", "o": "odd"}[turn] for turn in node]
        return ".".join(["trees", stack, *way, rest])
    return re.sub(r"^(paf|tsdp)\.", "", "tsdp.head" + name[len("tsdp.output"):] if name.startswith("tsdp.output") else name)


def with_the_same_weights(network, folder):
    """Every weight of the file finds its place and none is left over; gives the inputs of the window, and what should come out."""
    weights = {name_here(name): tensor for name, tensor in load_file(folder / "hybrid.safetensors").items()}
    missing, unexpected = network.load_state_dict(weights, strict=False)
    if unexpected or set(missing) != {"encoding"}:
        sys.exit(f"weights without a place: {unexpected}; places without weights: {missing}")
    window = load_file(folder / "window.safetensors")
    return (window["input.state"], window["input.physics"]), window["output"]


def difference(output, expected):
    return float((torch.as_tensor(output).double() - expected).abs().max() / expected.abs().max())


def resident_mib():
    for line in open("/proc/self/status"):
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    return None


def onnx_session(network, inputs):
    import onnxruntime

    file = io.BytesIO()
    torch.onnx.export(network, inputs, file, input_names=["state", "physics"], output_names=["out"], dynamo=False)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(file.getvalue(), options, providers=["CPUExecutionProvider"])
    state, physics = (tensor.numpy() for tensor in inputs)
    return (lambda: session.run(None, {"state": state, "physics": physics})[0]), f"ONNX Runtime {onnxruntime.__version__}"


def main():
    case, history, width, levels, seconds = sys.argv[1], *map(int, sys.argv[2:6])
    torch.set_num_threads(1)
    torch_step.WIDTH, torch_step.LEVELS = width, levels
    network = torch_step.PhyTure(history, 0.0, "naive" if case in ("naive", "onnx") else "fused").eval()
    inputs, expected = with_the_same_weights(network, pathlib.Path(sys.argv[6]))
    version = f"PyTorch {torch.__version__}"
    if case == "onnx":
        predict, version = onnx_session(network, inputs)
    else:
        run = torch.compile(network) if case == "compile" else network

        def predict():
            with torch.inference_mode():
                return run(*inputs)

    for _ in range(10):
        found = difference(predict(), expected)
    if not found <= LARGEST_DIFFERENCE:
        sys.exit(f"the output differs by {found:.1e} of the largest one")
    times, begun = [], time.perf_counter()
    for sample in range(seconds * 100):
        time.sleep(max(0.0, begun + 0.01 * sample - time.perf_counter()))
        start = time.perf_counter()
        predict()
        times.append(time.perf_counter() - start)
    print(json.dumps({"seconds": times, "resident_mib": resident_mib(), "difference": found, "version": version}))


if __name__ == "__main__":
    main()
