"""What bindings/xla_ffi.hpp says of XLA's structures, against the headers of the jaxlib that is there. Truth: the compiler."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

OURS = Path(__file__).parents[2] / "bindings"
PAIRS = {  # ours: (theirs, {field: field})
    "Extension": ("Extension_Base InternalExtension", {"type": "type", "next": "next"}),
    "Version": ("Api_Version", {"major": "major_version", "minor": "minor_version"}),
    "Metadata": ("Metadata", {"version": "api_version", "traits": "traits"}),
    "MetadataExtension": ("Metadata_Extension", {"metadata": "metadata"}),
    "ErrorCreate": ("Error_Create_Args", {"message": "message", "code": "errc"}),
    "StreamGet": ("Stream_Get_Args", {"context": "ctx", "stream": "stream"}),
    "Api": ("Api", {"version": "api_version", "internal": "internal_api", "error_create": "XLA_FFI_Error_Create",
                    "stream_get": "XLA_FFI_Stream_Get"}),
    "Buffer": ("Buffer", {"dtype": "dtype", "data": "data", "rank": "rank", "dims": "dims"}),
    "Buffers": ("Args", {"size": "size", "types": "types", "items": "args"}),
    "Text": ("ByteSpan", {"begin": "ptr", "size": "len"}),
    "Scalar": ("Scalar", {"dtype": "dtype", "value": "value"}),
    "Attributes": ("Attrs", {"size": "size", "types": "types", "names": "names", "items": "attrs"}),
    "CallFrame": ("CallFrame", {"api": "api", "context": "ctx", "stage": "stage", "arguments": "args", "results": "rets",
                                "attributes": "attrs"}),
}
VALUES = {"kMetadata": "Extension_Metadata", "kInvalidArgument": "Error_Code_INVALID_ARGUMENT", "kS32": "DataType_S32",
          "kS64": "DataType_S64", "kF32": "DataType_F32", "kF64": "DataType_F64", "kScalar": "AttrType_SCALAR",
          "kText": "AttrType_STRING", "kExecute": "ExecutionStage_EXECUTE"}


def test_layout(tmp_path):
    jax = pytest.importorskip("jax")
    compiler = shutil.which(os.environ.get("CXX", "c++"))
    if not hasattr(jax, "ffi") or compiler is None:
        pytest.skip("needs jax.ffi and a C++ compiler")
    include = jax.ffi.include_dir()
    header = Path(include, "xla/ffi/api/c_api.h").read_text()
    lines = ['#include "xla/ffi/api/c_api.h"', '#include "xla_ffi.hpp"', "namespace ours = espalier::python::xla;"]
    for ours, (names, fields) in PAIRS.items():
        theirs = next("XLA_FFI_" + n for n in names.split() if f"XLA_FFI_{n}" in header)
        for a, b in fields.items():
            lines.append(f'static_assert(offsetof(ours::{ours}, {a}) == offsetof({theirs}, {b}), "{ours}.{a}");')
            lines.append(f'static_assert(sizeof(ours::{ours}::{a}) == sizeof((({theirs}*)0)->{b}), "{ours}.{a}");')
    lines += [f'static_assert(ours::{a} == XLA_FFI_{b}, "{a}");' for a, b in VALUES.items()]
    lines.append("static_assert(sizeof(ours::Buffers) == sizeof(XLA_FFI_Rets) && XLA_FFI_API_MAJOR == 0);")
    source = tmp_path / "layout.cpp"
    source.write_text("\n".join(lines))
    done = subprocess.run([compiler, "-std=c++20", "-fsyntax-only", "-I", include, "-I", str(OURS), str(source)],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
