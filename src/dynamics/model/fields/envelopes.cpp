#include "dynamics/model/fields/envelopes.hpp"

#include "dynamics/model/fields/field_quantity.hpp"
#include "dynamics/model/fields/field_request.hpp"

namespace espalier::dynamics::model {

Envelopes::Envelopes(Mechanism& mechanism, const std::vector<std::string>& requests, const Place& place) {
  const auto find = [&](const std::string& request, Statistic otherwise) {
    return is_field_request(request) ? find_field_quantities(mechanism, request, place, otherwise)
                                     : find_quantities(mechanism, request, place);
  };
  for (const std::string& request : requests) {
    std::vector<Quantity> largest = find(request, Statistic::max), least = find(request, Statistic::min);
    for (std::size_t k = 0; k < largest.size(); ++k) {
      found_.push_back({largest[k].name, {}, {}});
      quantities_.push_back({std::move(largest[k]), std::move(least[k])});
    }
  }
}

void Envelopes::take(const Sample& s) {
  const auto note = [&](SimulationExtreme& known, const Quantity& q, double sign) {
    const FieldQuantity::Peak peak = q.field ? q.field->peak(s) : FieldQuantity::Peak{q.value(s), nullptr};
    if (begun_ && !(sign * peak.value > sign * known.value)) return;
    known = {peak.value, s.time(), {}, 0, {}};
    if (peak.site == nullptr) return;
    known.body = q.field->body().body().spec.name;
    known.node = peak.site->node;
    for (int i = 0; i < 3; ++i) known.place[at(i)] = peak.site->place[i];
  };
  for (std::size_t k = 0; k < quantities_.size(); ++k) {
    note(found_[k].largest, quantities_[k].largest, 1);
    note(found_[k].least, quantities_[k].least, -1);
  }
  begun_ = true;
}

}  // namespace espalier::dynamics::model
