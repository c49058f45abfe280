#include "dynamics/page/thin_stress.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "base/at.hpp"
#include "dynamics/model/fields/field_quantity.hpp"

namespace espalier::dynamics::page {
namespace {

constexpr std::size_t kOfSite = std::tuple_size_v<model::SiteNumbers>;

void add_named(std::vector<model::Measure> from, const char* name, std::vector<model::Measure>& to) {
  for (model::Measure& measure : from)
    if (measure.name == name) to.push_back(std::move(measure));
}

struct AtNode {
  double von_mises = 0, principal = 0;
};

}  // namespace

ThinStress::ThinStress(const model::Mechanism& mechanism, const Drawn& drawn) : mechanism_(mechanism) {
  for (std::size_t b = 0; b < mechanism.bodies.size(); ++b) {
    const Skin* skin = drawn.skins()[b].get();
    if (skin == nullptr) continue;
    const std::size_t first = points_;
    points_ += at(skin->points());
    const model::BuiltBody& built = mechanism.bodies[b];
    if (built.mesh) continue;
    try {
      const auto samples = std::make_shared<model::SampledBody>(built);
      Body body{nullptr, nullptr, {}, {}, samples->kind() == model::FieldBody::shell, first, at(skin->points()), 1};
      if (body.shell) {
        for (const char* name : {"principal_1", "principal_3"})
          add_named(model::tensor_measures(true), name, body.extremes);
        add_named(model::tensor_measures(true), "von_mises", body.von_mises);
      } else {
        for (const model::Statistic statistic : {model::Statistic::max, model::Statistic::min})
          add_named(model::fibre_measures(*samples, statistic), "xx", body.extremes);
        add_named(model::fibre_measures(*samples, model::Statistic::none), "von_mises", body.von_mises);
        body.around = static_cast<std::size_t>(std::count(skin->labels.begin(), skin->labels.end(), skin->labels[0]));
      }
      body.sites = std::make_shared<model::Sites>(model::find_sites(*samples, model::Where{}, false, true));
      body.numbers = std::make_shared<model::FieldQuantity>(samples, body.sites, model::FieldKind::stress,
                                                            body.extremes[0], model::Statistic::none, nullptr);
      bodies_.push_back(std::move(body));
    } catch (const std::invalid_argument&) {  // no elements, or a section without an outline
    }
  }
}

std::vector<double> ThinStress::keep(const State& s) const {
  const auto numbers = [this](const State& there) {
    model::Sample sample;
    sample.state = &there;
    std::vector<double> all;
    for (const Body& body : bodies_) {
      const std::vector<double> own = body.numbers->numbers(sample);
      all.insert(all.end(), own.begin(), own.end());
    }
    return all;
  };
  const model::LinearResponse* linear = mechanism_.linear.get();
  if (linear == nullptr) return numbers(s);
  return linear->of(numbers, linear->load() != 0 ? s.t / linear->load() : 1);
}

void ThinStress::add_to(const std::vector<double>& kept, std::vector<double>& von_mises,
                        std::vector<double>& principal) const {
  for (auto* all : {&von_mises, &principal}) all->resize(points_, std::numeric_limits<double>::quiet_NaN());
  const double* from = kept.data();
  for (const Body& body : bodies_) {
    std::vector<AtNode> at_sites;
    for (const model::Site& site : body.sites->list) {
      model::SiteNumbers n;
      std::copy_n(from, kOfSite, n.begin());
      from += kOfSite;
      const double a = body.extremes[0].value(n, site), b = body.extremes[1].value(n, site);
      const double largest = std::abs(a) >= std::abs(b) ? a : b;
      at_sites.push_back({body.von_mises.empty() ? std::abs(largest) : body.von_mises[0].value(n, site), largest});
    }
    const auto set = [&](std::size_t point, const AtNode& x) {
      von_mises[body.first + point] = x.von_mises;
      principal[body.first + point] = x.principal;
    };
    if (body.shell) {  // sites: bottom and top of each node; points: all tops, then all bottoms
      const std::size_t nodes = body.points / 2;
      for (std::size_t k = 0; k < nodes; ++k) set(k, at_sites[2 * k + 1]), set(nodes + k, at_sites[2 * k]);
      continue;
    }
    const std::size_t rings = body.points / body.around, pieces = (rings - 1) / (at_sites.size() - 1);
    for (std::size_t ring = 0; ring < rings; ++ring) {
      const std::size_t node = std::min(ring / pieces, at_sites.size() - 2);
      const double share = static_cast<double>(ring - node * pieces) / static_cast<double>(pieces);
      const AtNode &a = at_sites[node], &b = at_sites[node + 1];
      const AtNode x{(1 - share) * a.von_mises + share * b.von_mises, (1 - share) * a.principal + share * b.principal};
      for (std::size_t k = 0; k < body.around; ++k) set(ring * body.around + k, x);
    }
  }
}

}  // namespace espalier::dynamics::page
