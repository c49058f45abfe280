#include "dynamics/model/assembly/line_elements.hpp"

namespace espalier::dynamics::model {
namespace {

std::vector<LineElement> elements_of(const std::vector<LineChain>& chains) {
  std::vector<LineElement> out;
  for (const LineChain& chain : chains) {
    Index node = chain.first;
    for (const double length : chain.lengths) {
      out.push_back({{node, node + 1}, length});
      ++node;
    }
  }
  return out;
}

}  // namespace

std::vector<LineChain> line_chains(const BuiltBody& body) {
  const auto one = [](Index elements, double length) {
    return std::vector{LineChain{0, std::vector(at(elements), length), 0}};
  };
  if (const auto* cable = std::get_if<CableSpec>(&body.spec.shape))
    return cable->file ? cable->file->chains
                       : one(cable->elements, (cable->end - cable->start).norm() / cable->elements);
  if (const auto* beam = std::get_if<BeamSpec>(&body.spec.shape))
    return beam->file ? beam->file->chains
                      : one(beam->elements, make_beam_axis(*beam->axis, beam->y, beam->elements).element_length);
  return {};
}

std::vector<LineElement> line_elements(const BuiltBody& body) { return elements_of(line_chains(body)); }

BeamSpec::ChainSection section_of_chain(const BeamSpec& beam, const LineChain& chain) {
  return beam.file ? beam.sections[chain.section] : BeamSpec::ChainSection{beam.section, beam.outline};
}

CableSection section_of_chain(const CableSpec& cable, const LineChain& chain) {
  return cable.file ? cable.sections[chain.section] : cable.section;
}

}  // namespace espalier::dynamics::model
