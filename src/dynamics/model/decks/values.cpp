#include "dynamics/model/decks/values.hpp"

namespace espalier::dynamics::model {

Value ValueMaker::make(Value::Type type) const {
  Value value;
  value.type = type;
  value.place = place_;
  return value;
}

Value ValueMaker::number(double x) const {
  Value value = make(Value::Type::real);
  value.real = x;
  return value;
}

Value ValueMaker::whole(std::int64_t x) const {
  Value value = make(Value::Type::integer);
  value.integer = x;
  value.real = static_cast<double>(x);
  return value;
}

Value ValueMaker::text(const std::string& x) const {
  Value value = make(Value::Type::text);
  value.text = x;
  return value;
}

Value ValueMaker::flag(bool x) const {
  Value value = make(Value::Type::boolean);
  value.boolean = x;
  return value;
}

Value ValueMaker::list(std::vector<Value> items) const {
  Value value = make(Value::Type::array);
  value.items = std::move(items);
  return value;
}

Value ValueMaker::vector(const Point& x) const { return list({number(x[0]), number(x[1]), number(x[2])}); }

Value ValueMaker::table(std::initializer_list<std::pair<const char*, Value>> entries) const {
  Value value = make(Value::Type::table);
  for (const auto& [key, entry] : entries) {
    value.entries.emplace_back(key, entry);
    value.entries.back().second.place.path = place_.path + "." + key;
  }
  return value;
}

}  // namespace espalier::dynamics::model
