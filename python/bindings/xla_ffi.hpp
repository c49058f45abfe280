/// \file
/// What a handler of XLA's foreign function interface is called with: the part of its C interface (xla/ffi/api/c_api.h
/// of OpenXLA, major version 0) that xla.cpp needs, declared here so that the package is built without JAX. These
/// structures only grow at their ends, and each says how long it is. python/tests/linear/test_xla_layout.py holds them
/// against the headers of the jaxlib that is there.
#pragma once

#include <cstddef>
#include <cstdint>

namespace espalier::python::xla {

struct Error;             ///< made by Api::error_create, belongs to XLA once it is returned
struct ExecutionContext;  ///< of one call

struct Extension {
  std::size_t struct_size;
  int type;
  Extension* next;
};
constexpr int kMetadata = 1;  ///< Extension::type

struct Version {
  std::size_t struct_size;
  Extension* extensions;
  int major, minor;
};

/// What XLA asks for before it calls a handler for the first time.
struct Metadata {
  std::size_t struct_size;
  Version version;       ///< of the interface that the handler speaks
  std::uint32_t traits;  ///< 0: not to be recorded in a CUDA graph
};

struct MetadataExtension {
  Extension base;
  Metadata* metadata;
};

struct ErrorCreate {
  std::size_t struct_size;
  Extension* extensions;
  const char* message;
  int code;
};
constexpr int kInvalidArgument = 3;  ///< ErrorCreate::code

struct StreamGet {
  std::size_t struct_size;
  Extension* extensions;
  ExecutionContext* context;
  void* stream;  ///< out: a CUstream
};

/// The beginning of the table of functions.
struct Api {
  std::size_t struct_size;
  Extension* extensions;
  Version version;
  const void* internal;
  Error* (*error_create)(ErrorCreate*);
  void (*error_get_message)(void*);
  void (*error_destroy)(void*);
  Error* (*handler_register)(void*);
  Error* (*stream_get)(StreamGet*);
};

/// Types of numbers, as XLA calls them.
enum : int { kS32 = 4, kS64 = 5, kF32 = 11, kF64 = 12 };

struct Buffer {
  std::size_t struct_size;
  Extension* extensions;
  int dtype;
  void* data;
  std::int64_t rank;
  std::int64_t* dims;  ///< row-major
};

/// Arguments, or results: of type 1, buffers.
struct Buffers {
  std::size_t struct_size;
  Extension* extensions;
  std::int64_t size;
  int* types;
  void** items;
};

struct Text {
  const char* begin;
  std::size_t size;
};

struct Scalar {
  int dtype;
  void* value;
};

/// Attributes, sorted by name.
struct Attributes {
  std::size_t struct_size;
  Extension* extensions;
  std::int64_t size;
  int* types;
  Text** names;
  void** items;
};
constexpr int kScalar = 3, kText = 4;  ///< Attributes::types

struct CallFrame {
  std::size_t struct_size;
  Extension* extensions;
  const Api* api;
  ExecutionContext* context;
  int stage;
  Buffers arguments, results;
  Attributes attributes;
};
constexpr int kExecute = 3;  ///< CallFrame::stage

}  // namespace espalier::python::xla
