// Handlers for XLA's foreign function interface: espalier/jax.py registers them and is called by them, with the buffers
// as they lie. Python's global lock is held while it finds the solver, not while that works.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "xla_ffi.hpp"

namespace espalier::python {

namespace nb = nanobind;
using namespace nb::literals;

namespace {

// What is called: (attributes, stream or None, arguments, results). Not an nb::object: handlers may run while the
// interpreter ends.
PyObject* the_call = nullptr;

xla::Error* error_of(const xla::Api& api, const std::string& message) {
  xla::ErrorCreate create{sizeof(xla::ErrorCreate), nullptr, message.c_str(), xla::kInvalidArgument};
  return api.error_create(&create);
}

// XLA asks for the version before the first call. What we use of the interface has been there, and has not changed,
// from its beginning on: the version is XLA's own.
bool answer_metadata(const xla::CallFrame& frame) {
  if (frame.extensions == nullptr || frame.extensions->type != xla::kMetadata) return false;
  xla::Metadata& m = *reinterpret_cast<xla::MetadataExtension*>(frame.extensions)->metadata;
  m.version = {sizeof(xla::Version), nullptr, frame.api->version.major, frame.api->version.minor};
  m.traits = 0;
  return true;
}

std::optional<nb::dlpack::dtype> number_type(int xla_type) {
  const auto type = [](nb::dlpack::dtype_code code, int bits) {
    return nb::dlpack::dtype{static_cast<std::uint8_t>(code), static_cast<std::uint8_t>(bits), 1};
  };
  switch (xla_type) {
    case xla::kS32:
      return type(nb::dlpack::dtype_code::Int, 32);
    case xla::kS64:
      return type(nb::dlpack::dtype_code::Int, 64);
    case xla::kF32:
      return type(nb::dlpack::dtype_code::Float, 32);
    case xla::kF64:
      return type(nb::dlpack::dtype_code::Float, 64);
    default:
      return std::nullopt;
  }
}

// A buffer of the host as an array of NumPy over the same memory, one of a GPU as (address, shape, NumPy's type).
nb::object array_over(const xla::Buffer& buffer, bool on_host) {
  const auto type = number_type(buffer.dtype);
  if (!type) throw nb::type_error("espalier takes buffers of int32, int64, float32 and float64");
  const auto rank = static_cast<std::size_t>(buffer.rank);
  const std::vector<std::size_t> shape(buffer.dims, buffer.dims + rank);
  if (on_host)
    return nb::cast(nb::ndarray<nb::numpy>(buffer.data, rank, shape.data(), nb::handle(), nullptr, *type),
                    nb::rv_policy::reference);
  nb::list sizes;
  for (const std::size_t n : shape) sizes.append(n);
  const std::string kind = type->code == static_cast<std::uint8_t>(nb::dlpack::dtype_code::Float) ? "<f" : "<i";
  return nb::make_tuple(reinterpret_cast<std::uintptr_t>(buffer.data), nb::tuple(sizes),
                        kind + std::to_string(type->bits / 8));
}

nb::list arrays_over(const xla::Buffers& buffers, bool on_host) {
  nb::list list;
  for (std::int64_t k = 0; k < buffers.size; ++k)
    list.append(array_over(*static_cast<const xla::Buffer*>(buffers.items[k]), on_host));
  return list;
}

nb::dict attributes_of(const xla::Attributes& all) {
  nb::dict dict;
  for (std::int64_t k = 0; k < all.size; ++k) {
    const nb::str name(all.names[k]->begin, all.names[k]->size);
    if (all.types[k] == xla::kText) {
      const auto* text = static_cast<const xla::Text*>(all.items[k]);
      dict[name] = nb::str(text->begin, text->size);
    } else if (all.types[k] == xla::kScalar) {
      const auto* scalar = static_cast<const xla::Scalar*>(all.items[k]);
      if (scalar->dtype == xla::kS64) dict[name] = *static_cast<const std::int64_t*>(scalar->value);
    }
  }
  return dict;
}

// XLA's stream of a call on a GPU. @return what went wrong, or nothing
xla::Error* stream_of(const xla::CallFrame& frame, std::uintptr_t& stream) {
  xla::StreamGet get{sizeof(xla::StreamGet), nullptr, frame.context, nullptr};
  if (xla::Error* error = frame.api->stream_get(&get)) return error;
  stream = reinterpret_cast<std::uintptr_t>(get.stream);
  return nullptr;
}

std::string words(const nb::python_error& error) { return nb::str(error.value()).c_str(); }

xla::Error* handle(const xla::CallFrame& frame, bool on_host) {
  if (answer_metadata(frame) || frame.stage != xla::kExecute) return nullptr;
  std::uintptr_t stream = 0;
  if (!on_host)
    if (xla::Error* error = stream_of(frame, stream)) return error;
  if (!Py_IsInitialized()) return error_of(*frame.api, "Python has ended");
  const nb::gil_scoped_acquire gil;
  try {
    const nb::object where = on_host ? nb::none() : nb::cast(stream);
    nb::borrow(the_call)(attributes_of(frame.attributes), where, arrays_over(frame.arguments, on_host),
                         arrays_over(frame.results, on_host));
    return nullptr;
  } catch (const nb::python_error& error) {  // what() would print the whole way to it
    return error_of(*frame.api, nb::str(error.type().attr("__name__")).c_str() + (": " + words(error)));
  } catch (const std::exception& error) {
    return error_of(*frame.api, error.what());
  }
}

xla::Error* on_host(xla::CallFrame* frame) { return handle(*frame, true); }
xla::Error* on_gpu(xla::CallFrame* frame) { return handle(*frame, false); }

nb::capsule capsule_of(xla::Error* (*handler)(xla::CallFrame*)) {
  return nb::capsule(reinterpret_cast<void*>(handler), "xla._CUSTOM_CALL_TARGET");  // the name that JAX expects
}

}  // namespace

void bind_xla(nb::module_& m) {
  m.def(
      "xla_handlers",
      [](nb::object call) {
        PyObject* before = std::exchange(the_call, call.release().ptr());
        Py_XDECREF(before);
        nb::dict by_platform;
        by_platform["cpu"] = capsule_of(&on_host);
        by_platform["CUDA"] = capsule_of(&on_gpu);
        return by_platform;
      },
      "call"_a);
}

}  // namespace espalier::python
