/// \file
/// Values of a model that no text states, made by a program.
#pragma once

#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/mesh/deck/deck.hpp"
#include "dynamics/model/read/value.hpp"

namespace espalier::dynamics::model {

/// Makes values that stand at one line of a deck.
class ValueMaker {
 public:
  ValueMaker(const DeckPlace& place, std::string path)
      : place_{place.file, static_cast<int>(place.line), std::move(path)} {}
  [[nodiscard]] Value number(double x) const;
  [[nodiscard]] Value whole(std::int64_t x) const;
  [[nodiscard]] Value text(const std::string& x) const;
  [[nodiscard]] Value flag(bool x) const;
  [[nodiscard]] Value list(std::vector<Value> items) const;
  [[nodiscard]] Value vector(const Point& x) const;
  [[nodiscard]] Value table(std::initializer_list<std::pair<const char*, Value>> entries) const;
  [[nodiscard]] const Place& place() const { return place_; }

 private:
  [[nodiscard]] Value make(Value::Type type) const;
  Place place_;
};

}  // namespace espalier::dynamics::model
