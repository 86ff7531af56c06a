"""Reference scenes of rigid impacts: cases/, solutions/, protocol.md, and the command carom-references (console.py)."""
