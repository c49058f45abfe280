"""The extension module of espalier with GPU kernels in it. Not to be imported: `import espalier` finds it."""

__version__ = "0.1.0"
