"""Packs a built extension and the Python sources into a wheel: `wheel.py LIBRARY FOLDER`. Compiles nothing; releases are built by maturin.

A wheel is a zip of the package beside three texts: METADATA, WHEEL, RECORD.
"""

import base64
import hashlib
import pathlib
import re
import sys
import sysconfig
import zipfile

HERE = pathlib.Path(__file__).resolve().parent
#: The oldest interpreter; newer ones load the same extension.
ABI = "cp310-abi3"


def version() -> str:
    """The version of the workspace."""
    text = (HERE / "../../../Cargo.toml").read_text(encoding="utf-8")
    found = re.search(r'^\[workspace\.package\]\nversion = "([^"]+)"', text, re.MULTILINE)
    if not found:
        raise SystemExit("Cargo.toml: no version under [workspace.package]")
    return found[1]


def pack(library: pathlib.Path, folder: pathlib.Path) -> pathlib.Path:
    """Writes the wheel into the folder, and says where it is."""
    platform = re.sub(r"[^0-9A-Za-z]", "_", sysconfig.get_platform())
    name, tag = f"phyture-{version()}", f"{ABI}-{platform}"
    ending = "pyd" if library.suffix == ".dll" else "abi3.so"
    contents = {f"phyture/_phyture.{ending}": library.read_bytes()}
    for path in sorted((HERE / "python/phyture").iterdir()):
        if path.suffix in (".py", ".pyi") or path.name == "py.typed":
            contents[f"phyture/{path.name}"] = path.read_bytes()
    metadata = f"Metadata-Version: 2.1\nName: phyture\nVersion: {version()}\nRequires-Python: >=3.10\n"
    about = f"Wheel-Version: 1.0\nGenerator: wheel.py\nRoot-Is-Purelib: false\nTag: {tag}\n"
    contents[f"{name}.dist-info/METADATA"] = metadata.encode()
    contents[f"{name}.dist-info/WHEEL"] = about.encode()
    record = ""
    for path, content in contents.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        record += f"{path},sha256={digest},{len(content)}\n"
    own = f"{name}.dist-info/RECORD"
    contents[own] = f"{record}{own},,\n".encode()
    folder.mkdir(parents=True, exist_ok=True)
    wheel = folder / f"{name}-{tag}.whl"
    # Stored: it is unpacked at once.
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_STORED) as archive:
        for path, content in contents.items():
            archive.writestr(path, content)
    return wheel


if __name__ == "__main__":
    if len(sys.argv) != 3:
        raise SystemExit(__doc__)
    print(pack(pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])))
