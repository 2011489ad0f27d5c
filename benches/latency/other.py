"""One row of the latency of other programs: a forward pass of Phy-Ture on one window, called at 100 Hz in real time. Prints one JSON line.

    other.py CASE HISTORY WIDTH LEVELS SECONDS

CASE is `naive`, `fused` or `compile` for PyTorch (the network of benches/peers/torch_step.py), `onnx` for ONNX Runtime on what PyTorch exports. Started
by `run.py` beside it.
"""

import io
import json
import pathlib
import sys
import time

import torch

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "peers"))
import torch_step  # noqa: E402


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
    return (lambda: session.run(None, {"state": state, "physics": physics})), f"ONNX Runtime {onnxruntime.__version__}"


def main():
    case, history, width, levels, seconds = sys.argv[1], *map(int, sys.argv[2:6])
    torch.set_num_threads(1)
    torch.manual_seed(0)
    torch_step.WIDTH, torch_step.LEVELS = width, levels
    network = torch_step.PhyTure(history, 0.0, "naive" if case in ("naive", "onnx") else "fused").eval()
    inputs = torch.rand(1, history, torch_step.STATES) * 2 - 1, torch.rand(1, history, torch_step.PHYSICS) * 2 - 1
    version = f"PyTorch {torch.__version__}"
    if case == "onnx":
        predict, version = onnx_session(network, inputs)
    else:
        run = torch.compile(network) if case == "compile" else network

        def predict():
            with torch.inference_mode():
                return run(*inputs)

    for _ in range(10):
        predict()
    times, begun = [], time.perf_counter()
    for sample in range(seconds * 100):
        time.sleep(max(0.0, begun + 0.01 * sample - time.perf_counter()))
        start = time.perf_counter()
        predict()
        times.append(time.perf_counter() - start)
    print(json.dumps({"seconds": times, "resident_mib": resident_mib(), "version": version}))


if __name__ == "__main__":
    main()
