/// \file
/// One message between ranks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <utility>

namespace espalier::ranks {

/// How every message begins. What the fields of the second half mean is up to the sort of message.
struct Header {
  std::uint32_t call = 0;       ///< of the caller's collective calls
  std::uint32_t operation = 0;  ///< of this call's operations
  std::int32_t kind = 0;        ///< below 0: the link's own (MessageKind)
  std::int32_t front = 0;
  std::int32_t row = 0;
  std::int32_t column = 0;
  std::int64_t number = 0;
};

/// Bytes that several receivers may share.
class Message {
 public:
  Message() = default;
  explicit Message(std::size_t body_bytes)
      : bytes_(sizeof(Header) + body_bytes), data_(std::make_shared_for_overwrite<std::byte[]>(bytes_)) {
    set_header({});
  }
  /// A message of all its bytes, header included.
  static Message of_bytes(std::size_t bytes) {
    Message m;
    m.bytes_ = bytes;
    m.data_ = std::make_shared_for_overwrite<std::byte[]>(bytes);
    return m;
  }

  /// The same in memory of the caller's, which has room for them.
  static Message in(std::shared_ptr<std::byte[]> memory, std::size_t bytes) {
    Message m;
    m.bytes_ = bytes;
    m.data_ = std::move(memory);
    return m;
  }

  [[nodiscard]] Header header() const {
    Header h;
    std::memcpy(&h, data_.get(), sizeof h);
    return h;
  }
  void set_header(const Header& h) { std::memcpy(data_.get(), &h, sizeof h); }
  [[nodiscard]] std::byte* body() { return data_.get() + sizeof(Header); }
  [[nodiscard]] const std::byte* body() const { return data_.get() + sizeof(Header); }
  [[nodiscard]] std::size_t body_bytes() const { return bytes_ - sizeof(Header); }
  [[nodiscard]] std::byte* data() { return data_.get(); }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }
  /// Expires when nobody holds the bytes any more.
  [[nodiscard]] std::weak_ptr<const std::byte[]> watch() const { return data_; }

 private:
  std::size_t bytes_ = 0;
  std::shared_ptr<std::byte[]> data_;
};

/// Reads and writes a body from its beginning on.
class Writer {
 public:
  explicit Writer(std::byte* at) : at_(at) {}
  template <class T>
  void write(const T* from, std::size_t count) {
    if (count > 0) std::memcpy(at_, from, count * sizeof(T));
    at_ += count * sizeof(T);
  }

 private:
  std::byte* at_;
};
class Reader {
 public:
  Reader(const std::byte* at, std::size_t bytes) : at_(at), end_(at + bytes) {}
  template <class T>
  void get(T* to, std::size_t count) {
    if (count > 0) std::memcpy(to, at_, count * sizeof(T));
    at_ += count * sizeof(T);
  }
  [[nodiscard]] const std::byte* at() const { return at_; }
  [[nodiscard]] std::size_t left() const { return static_cast<std::size_t>(end_ - at_); }

 private:
  const std::byte* at_;
  const std::byte* end_;
};

}  // namespace espalier::ranks
