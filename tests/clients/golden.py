"""The message that pins the protocol, as bytes and as text. Importing this makes `lightcast` importable."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "clients"))

BIN = (ROOT / "tests/golden/message.bin").read_bytes()
TEXT = (ROOT / "tests/golden/message.json").read_text()
