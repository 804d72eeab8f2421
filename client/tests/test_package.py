"""What the package offers: every public name documented, nothing imported beyond what it declares."""

import subprocess
import sys

DECLARED = {"numpy", "httpx"}
OF_THESE = {"httpcore", "h11", "anyio", "certifi", "idna", "sniffio", "exceptiongroup", "typing_extensions"}


def test_nothing_is_imported_that_is_not_declared():
    """Not counted: what httpx tries to import for its command line (click, rich), and what .pth files import."""
    code = (
        "import sys; before = set(sys.modules);"
        "sys.modules.update(dict.fromkeys(('click', 'rich', 'pygments', 'cv2', 'msgpack', 'scipy')));"
        "import roboprompt_client.cli;"
        "print(*{name.split('.')[0] for name, module in sys.modules.items() if getattr(module, '__file__', None)"
        " and 'site-packages' in module.__file__ and name not in before})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    foreign = {name for name in done.stdout.split() if not name.startswith(("_", "sitecustomize"))}
    assert foreign >= DECLARED
    assert foreign <= DECLARED | OF_THESE | {
        "roboprompt_client",
        "h2",
        "hpack",
        "hyperframe",
        "socksio",
        "brotli",
        "zstandard",
        "brotlicffi",
    }
