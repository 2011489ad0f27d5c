"""Every block of docs/python.md and every cell of the notebook runs."""

import pathlib
import re
import shutil

import nbclient
import nbformat

HERE = pathlib.Path(__file__).resolve().parent


def test_the_blocks_of_the_document_run_one_after_the_other(folder, tmp_path, monkeypatch):
    text = (HERE / "../../../../docs/python.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(blocks) > 3
    shutil.copytree(folder / "flights", tmp_path / "flights")
    monkeypatch.chdir(tmp_path)
    names = {}
    for block in blocks:
        exec(compile(block, "docs/python.md", "exec"), names)
    assert names["diagnosis"].accepted == ["weathercock"]


def test_the_notebook_runs(tmp_path):
    notebook = nbformat.read(HERE / "../examples/demo.ipynb", as_version=4)
    assert all(not cell.outputs for cell in notebook.cells if cell.cell_type == "code")
    nbclient.NotebookClient(notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": tmp_path}}).execute()
    shown = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert any("image/svg+xml" in output.get("data", {}) for output in shown)
    assert any("weathercock" in str(output) for output in shown)
