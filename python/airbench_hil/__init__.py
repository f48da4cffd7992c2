"""Python on the embedded bus of airbench: a peer, a lockstep member, an interface of python-can, an emulated microcontroller."""

__version__ = "0.1.0"
