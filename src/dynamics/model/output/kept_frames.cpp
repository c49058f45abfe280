#include "dynamics/model/output/kept_frames.hpp"

#include <algorithm>
#include <functional>

namespace espalier::dynamics::model {

KeptFrames::KeptFrames(const Mechanism& mechanism, double interval, const State& from)
    : mechanism_(mechanism), scene_(mechanism) {
  times_.interval = interval;
  scene_.place(from);
  from_ = scene_.points();
}

void KeptFrames::begin(const State& s, double start) {
  frames_.clear();
  times_.start = start;
  times_.wind_to(s.t);
  if (times_.interval >= 0) take(s);
  before_ = s;
}

void KeptFrames::step(const State& s) {
  if (times_.interval < 0) return;
  times_.visit(mechanism_.system, before_, s, [this](const State& due) { take(due); });
  before_ = s;
}

void KeptFrames::restore(const State& s) {
  if (times_.interval < 0) return;
  std::erase_if(frames_, [&s](const SimulationFrame& f) { return f.t > s.t; });
  times_.wind_to(s.t);
  before_ = s;
}

void KeptFrames::take(const State& s) {
  if (frames_.empty() || frames_.back().t != s.t) frames_.push_back(frame(s));
}

SimulationFrame KeptFrames::frame(const State& s) {
  scene_.place(s);
  SimulationFrame f;
  f.t = s.t;
  f.points = scene_.points();
  f.velocity = scene_.velocity();
  f.displacement.resize(f.points.size());
  std::transform(f.points.begin(), f.points.end(), from_.begin(), f.displacement.begin(), std::minus<>());
  f.von_mises = scene_.von_mises(s);
  return f;
}

SimulationMesh KeptFrames::mesh() const {
  SimulationMesh m;
  const VtuCells& cells = scene_.cells();
  m.types = cells.types();
  m.offsets.assign(1, 0);
  m.offsets.insert(m.offsets.end(), cells.offsets().begin(), cells.offsets().end());
  m.connectivity = cells.connectivity();
  m.body = scene_.body();
  for (const BuiltBody& body : mechanism_.bodies) m.bodies.push_back(body.spec.name);
  return m;
}

}  // namespace espalier::dynamics::model
