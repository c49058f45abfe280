#include "matrix/generators/changing_body.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace espalier::matrix {

BodyChange parse_body_change(std::string_view word) {
  if (word == "contacts") return BodyChange::contacts;
  if (word == "elements") return BodyChange::elements;
  if (word == "crack") return BodyChange::crack;
  if (word == "remesh") return BodyChange::remesh;
  throw std::invalid_argument("a body changes by contacts, elements, crack or remesh, not by '" + std::string(word) +
                              "'");
}

ChangingBody::ChangingBody(BodyChange sort, Index n, double share, std::uint64_t seed)
    : sort_(sort),
      n_(n),
      nodes_a_step_(std::max<Index>(1, static_cast<Index>(share * std::pow(n + 1, 3)))),
      random_(seed),
      alive_(static_cast<std::size_t>(n) * static_cast<std::size_t>(n) * static_cast<std::size_t>(n), 1) {
  for (Index x = 0; x < n; ++x)
    for (Index y = 0; y < n; ++y)
      for (Index z = 0; z < n; ++z)
        elements_.push_back({node(x, y, z), node(x, y, z + 1), node(x, y + 1, z), node(x, y + 1, z + 1),
                             node(x + 1, y, z), node(x + 1, y, z + 1), node(x + 1, y + 1, z),
                             node(x + 1, y + 1, z + 1)});
  if (sort_ == BodyChange::contacts)
    for (Index k = 0; k < 10; ++k) slide();
}

void ChangingBody::change() {
  if (sort_ == BodyChange::contacts) slide();
  if (sort_ == BodyChange::elements) swap_elements();
  if (sort_ == BodyChange::crack) grow_crack();
  if (sort_ == BodyChange::remesh) remesh();
}

// A tenth of the springs comes, near a spot that moves on, and the oldest, those farthest behind, go.
void ChangingBody::slide() {
  ++step_;
  const Index wide = n_ + 1, spot = step_ % wide, most = nodes_a_step_;
  for (Index k = 0; k < std::max<Index>(1, most / 10); ++k) {
    const Index y = (spot + below(3)) % wide, z = below(wide);
    springs_.emplace(node(n_, y, z), node(n_ - 2, std::min(n_, y + below(2)), z));
  }
  while (static_cast<Index>(springs_.size()) > most) {
    auto victim = springs_.begin();
    std::advance(victim, below(static_cast<Index>(springs_.size())));
    springs_.erase(victim);
  }
}

// Up to a twentieth of the body is out at a time.
void ChangingBody::swap_elements() {
  ++step_;
  const auto wide = std::max<Index>(1, static_cast<Index>(std::cbrt(nodes_a_step_ / 2.0)));
  const Index x = below(std::max<Index>(1, n_ - wide)), y = below(std::max<Index>(1, n_ - wide)),
              z = below(std::max<Index>(1, n_ - wide));
  for (Index i = 0; i < wide && x + i < n_; ++i)
    for (Index j = 0; j < wide && y + j < n_; ++j)
      for (Index k = 0; k < wide && z + k < n_; ++k)
        if (const std::size_t e = element(x + i, y + j, z + k); alive_[e] != 0) {
          alive_[e] = 0;
          out_.push_back(e);
        }
  while (out_.size() > elements_.size() / 20) {
    alive_[out_.front()] = 1;
    out_.erase(out_.begin());
  }
}

void ChangingBody::grow_crack() {
  const Index length = n_ * n_ - n_, fail = std::max<Index>(1, std::min(nodes_a_step_, n_));
  for (Index k = 0; k < fail && step_ < length; ++k, ++step_) alive_[element(n_ / 2, step_ / n_, step_ % n_)] = 0;
}

// Nodes of a patch change places in its mesh, each with one at most two nodes away.
void ChangingBody::remesh() {
  ++step_;
  const auto wide = std::clamp<Index>(static_cast<Index>(std::cbrt(nodes_a_step_)), 2, n_);
  const Index x = below(n_ + 2 - wide), y = below(n_ + 2 - wide), z = below(n_ + 2 - wide);
  std::vector<Index> now(static_cast<std::size_t>((n_ + 1) * (n_ + 1) * (n_ + 1)));
  for (std::size_t k = 0; k < now.size(); ++k) now[k] = static_cast<Index>(k);
  for (Index i = 0; i < wide; ++i)
    for (Index j = 0; j < wide; ++j)
      for (Index k = 0; k < wide; ++k) {
        const auto near = [&](Index at) { return std::min(wide - 1, at + below(3)); };
        std::swap(now[static_cast<std::size_t>(node(x + i, y + j, z + k))],
                  now[static_cast<std::size_t>(node(x + near(i), y + near(j), z + near(k)))]);
      }
  for (auto& corners : elements_)
    for (Index& corner : corners) corner = now[static_cast<std::size_t>(corner)];
}

SparseMatrix ChangingBody::matrix() const {
  constexpr Index kPerNode = 3;
  const Index nodes = (n_ + 1) * (n_ + 1) * (n_ + 1);
  std::vector<std::vector<Index>> beside(static_cast<std::size_t>(nodes));  // with itself
  for (Index v = 0; v < nodes; ++v) beside[static_cast<std::size_t>(v)].push_back(v);
  for (std::size_t e = 0; e < elements_.size(); ++e)
    for (std::size_t i = 0; alive_[e] != 0 && i < 8; ++i)
      beside[static_cast<std::size_t>(elements_[e][i])].insert(beside[static_cast<std::size_t>(elements_[e][i])].end(),
                                                               elements_[e].begin(), elements_[e].end());
  for (const auto& [u, v] : springs_) {
    beside[static_cast<std::size_t>(u)].push_back(v);
    beside[static_cast<std::size_t>(v)].push_back(u);
  }
  SparseMatrix a;
  a.rows = a.cols = kPerNode * nodes;
  a.storage = Storage::symmetric_lower;
  a.col_ptr.assign(1, 0);
  for (Index v = 0; v < nodes; ++v) {
    auto& list = beside[static_cast<std::size_t>(v)];
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    for (Index d = 0; d < kPerNode; ++d) {
      for (const Index u : list)
        for (Index k = 0; k < kPerNode; ++k) {
          if (u < v || (u == v && k < d)) continue;
          a.row_ind.push_back(kPerNode * u + k);
          a.values.push_back(u == v && k == d ? static_cast<double>(kPerNode * list.size() + 1) : -1.0);
        }
      a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
    }
  }
  return a;
}

}  // namespace espalier::matrix
