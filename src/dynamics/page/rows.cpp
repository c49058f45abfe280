#include "dynamics/page/rows.hpp"

#include <algorithm>

namespace espalier::dynamics::page {

void Rows::begin(std::vector<std::string> names) {
  *this = {};
  names_ = std::move(names);
}

void Rows::add(double t, const std::vector<double>& values) {
  last_.assign(1, t);
  last_.insert(last_.end(), values.begin(), values.end());
  if (seen_++ % stride_ != 0) return;
  t_.push_back(t);
  values_.insert(values_.end(), values.begin(), values.end());
  constexpr std::size_t kMostRows = 20'000, kMostNumbers = 2'000'000;
  if (t_.size() > 100 && (t_.size() > kMostRows || values_.size() > kMostNumbers)) thin_out();
}

void Rows::thin_out() {
  const std::size_t width = names_.size();
  std::size_t to = 0;
  for (std::size_t from = 0; from < t_.size(); from += 2, ++to) {
    t_[to] = t_[from];
    std::copy_n(values_.begin() + static_cast<std::ptrdiff_t>(from * width), width,
                values_.begin() + static_cast<std::ptrdiff_t>(to * width));
  }
  t_.resize(to);
  values_.resize(to * width);
  stride_ *= 2;
}

void Rows::restore(double t) {
  while (!t_.empty() && t_.back() > t) {
    t_.pop_back();
    values_.resize(values_.size() - names_.size());
  }
  if (!last_.empty() && last_[0] > t) last_.clear();
}

SimulationSeries Rows::series() const {
  SimulationSeries out{names_, t_, values_};
  if (!last_.empty() && !t_.empty() && t_.back() != last_[0]) {
    out.t.push_back(last_[0]);
    out.values.insert(out.values.end(), last_.begin() + 1, last_.end());
  }
  return out;
}

std::vector<double> Rows::columns() const {
  const SimulationSeries all = series();
  std::vector<double> out = all.t;
  for (std::size_t c = 0; c < names_.size(); ++c)
    for (std::size_t row = 0; row < all.t.size(); ++row) out.push_back(all.values[row * names_.size() + c]);
  return out;
}

Rows rows_of(const SimulationSeries& series) {
  Rows rows;
  rows.begin(series.names);
  const std::size_t width = series.names.size();
  for (std::size_t k = 0; k < series.t.size(); ++k) {
    const auto from = series.values.begin() + static_cast<std::ptrdiff_t>(k * width);
    rows.add(series.t[k], {from, from + static_cast<std::ptrdiff_t>(width)});
  }
  return rows;
}

}  // namespace espalier::dynamics::page
