#include "dynamics/page/film.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "base/at.hpp"
#include "base/stopwatch.hpp"
#include "dynamics/page/failing_faces.hpp"
#include "dynamics/page/json_text.hpp"

namespace espalier::dynamics::page {
namespace {

constexpr std::size_t kUsual = 200, kFewest = 12;  // pictures
constexpr std::size_t kRoom = 40'000'000;          // bytes of large pictures; as letters 4/3 of them
constexpr std::size_t kLarge = 65'536;             // numbers of a picture that is compressed at once

void pack_place(const Drawn::Place& at, Quantized& out) {
  for (std::size_t i = 0; i < 3; ++i) out.add(at.points, i, 3);
  for (std::size_t i = 0; i < 3; ++i) out.add(at.positions, i, 3);
  out.add(at.quaternions);
}

std::vector<double> speeds_of(const std::vector<double>& rates) {
  std::vector<double> speeds;
  for (std::size_t k = 0; k < rates.size(); k += 3) speeds.push_back(std::hypot(rates[k], rates[k + 1], rates[k + 2]));
  return speeds;
}

}  // namespace

/// What the background makes a frame of.
struct Film::Taken {
  double t;
  Drawn::Place place;
  std::vector<double> marks;
  NodalStress::Kept stress;
  std::vector<double> thin;
};

Film::Film(const model::Mechanism& mechanism, const model::Description& model, double begin, double end, double wished)
    : mechanism_(mechanism),
      drawn_(mechanism),
      marks_(mechanism, model),
      stress_(mechanism, drawn_),
      thin_(mechanism, drawn_),
      most_(kUsual) {
  times_.start = begin;
  times_.interval = std::isfinite(end) && !model.statics ? (end - begin) / static_cast<double>(most_) : 0;
  const double in_run = wished > 0 ? (end - begin) / wished : 0;  // pictures that the model asks for
  if (times_.interval > 0 && in_run >= 150 && in_run <= static_cast<double>(most_)) times_.interval = wished;
}

std::vector<Film::Section> Film::sections() const {
  std::size_t points = 0, rigid = 0;
  for (const Drawn::Body& body : drawn_.bodies()) {
    if (body.rigid)
      ++rigid;
    else
      points += at(body.count);
  }
  const std::size_t marks = 3 * at(marks_.count()), strain = stress_.empty() ? 0 : points;
  const std::size_t stress = stress_.empty() && thin_.empty() ? 0 : points;
  return {{"x", points},         {"y", points},         {"z", points},       {"px", rigid},
          {"py", rigid},         {"pz", rigid},         {"turn", 4 * rigid}, {"speed", points},
          {"von_mises", stress}, {"principal", stress}, {"strain", strain},  {"velocity", 3 * rigid},
          {"omega", 3 * rigid},  {"a", marks},          {"b", marks},        {"axis", marks},
          {"force", marks},      {"moment", marks}};
}

void Film::begin(const model::Sample& s, const State& reference) {
  Drawn::Place place;
  drawn_.place(reference, place);
  rest_ = {};
  pack_place(place, rest_);
  frames_.clear();
  taken_ = 0;
  begun_ = std::chrono::steady_clock::now();
  before_ = s.pictured();
  times_.wind_to(before_.t);
  last_ = std::numeric_limits<double>::quiet_NaN();
  take(before_, *s.state);
}

void Film::step(const model::Sample& s) {
  const State now = s.pictured();
  if (times_.interval > 0) {
    times_.visit(mechanism_.system, before_, now, [&](const State& due) {
      if (!dear()) take(due, *s.state);
    });
    before_ = now;
  } else if (++seen_ % stride_ == 0 && !dear()) {
    take(now, *s.state);
  }
  if (taken_ > 2 * most_) thin_out();
  if (large_ > kRoom && taken_ > kFewest) {
    fewer_ = true;
    thin_out();
  }
}

bool Film::dear() {
  constexpr double kFree = 5, kShare = 0.05;  // seconds; of the time of the run
  const std::chrono::duration<double> run = std::chrono::steady_clock::now() - begun_;
  if (spent_ <= kFree + kShare * run.count()) return false;
  return fewer_ = true;
}

void Film::end(const model::Sample& s) { take(s.pictured(), *s.state); }

void Film::restore(const model::Sample& s) {
  background_.wait();
  before_ = s.pictured();
  std::erase_if(frames_, [this](const Frame& frame) { return frame.t > before_.t; });
  times_.wind_to(before_.t);
  taken_ = frames_.size();
  large_ = 0;
  for (const Frame& frame : frames_) large_ += frame.packed.size();
  last_ = frames_.empty() ? std::numeric_limits<double>::quiet_NaN() : frames_.back().t;
}

void Film::thin_out() {
  background_.wait();
  std::vector<Frame> kept;
  for (std::size_t k = 0; k < frames_.size(); k += 2) kept.push_back(std::move(frames_[k]));
  frames_ = std::move(kept);
  taken_ = frames_.size();
  large_ = 0;
  for (const Frame& frame : frames_) large_ += frame.packed.size();
  stride_ *= 2;
  if (times_.interval <= 0) return;
  times_.interval *= 2;
  times_.next = 0;
  times_.wind_to(before_.t);
}

// Takes a frame of interpolated states, and of those of a statics run, `s` has the time that is shown; forces are asked
// of `end`'s kind.
void Film::take(const State& s, const State& end) {
  if (last_ == s.t) return;
  last_ = s.t;
  ++taken_;
  auto taken = std::make_shared<Taken>();
  taken->t = s.t;
  drawn_.place(s, taken->place);
  StateView shown = s.view();
  if (times_.interval <= 0) shown.t = end.t;
  marks_.place(shown, end.view(), taken->marks);
  if (!stress_.empty()) taken->stress = stress_.keep(s);
  if (!thin_.empty()) taken->thin = thin_.keep(s);
  const auto make = [this, taken] {
    double seconds = 0;
    {
      const base::Stopwatch watch(seconds);
      frames_.push_back(frame_of(*taken));
    }
    spent_ = spent_ + seconds;
  };
  // A thread of its own is worth it where there is more to do than to wake it up.
  constexpr std::size_t kBeside = 2000;
  if (!stress_.empty() || taken->place.points.size() >= kBeside)
    background_.enqueue(make);
  else
    make();
}

Film::Frame Film::frame_of(const Taken& taken) {
  Frame frame;
  frame.t = taken.t;
  Quantized& out = frame.numbers;
  pack_place(taken.place, out);
  out.add(speeds_of(taken.place.rates));
  NodalStress::Values stress;
  if (!stress_.empty()) {
    stress = stress_.evaluate(taken.stress);
    frame.peaks = stress_.peaks(stress);
  }
  if (!thin_.empty()) thin_.add_to(taken.thin, stress.von_mises, stress.principal);
  out.add(stress.von_mises);
  out.add(stress.principal);
  out.add(stress.strain);
  out.add(taken.place.velocities);
  out.add(taken.place.turning);
  std::vector<double> part;
  for (std::size_t kind = 0; kind < 5; ++kind) {
    part.clear();
    for (std::size_t k = 3 * kind; k < taken.marks.size(); k += 15)
      part.insert(part.end(), taken.marks.begin() + static_cast<std::ptrdiff_t>(k),
                  taken.marks.begin() + static_cast<std::ptrdiff_t>(k + 3));
    out.add(part);
  }
  if (out.steps.size() >= kLarge) {
    frame.packed = compressed(split_bytes(out.steps));
    out.steps = {};
    large_ += frame.packed.size();
  }
  return frame;
}

void Film::swing(const State& about, const std::vector<Swing>& shapes) {
  background_.wait();
  State shown = about;
  Drawn::Place place;
  drawn_.place(about, place);
  const std::vector<double> base = drawn_.all_points(place);
  double extent = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (std::size_t k = i; k < base.size(); k += 3) low = std::min(low, base[k]), high = std::max(high, base[k]);
    extent = std::max(extent, high - low);
  }
  const auto displacements = [&](const std::vector<double>& shift, double scale) {
    std::vector<double> step = shift;
    for (double& x : step) x *= scale;
    mechanism_.system.retract(about.q, step, shown.q);
    drawn_.place(shown, place);
    std::vector<double> moved = drawn_.all_points(place);
    for (std::size_t k = 0; k < moved.size(); ++k) moved[k] = (moved[k] - base[k]) / scale;
    return moved;
  };
  std::vector<std::string> all;
  for (const Swing& shape : shapes) {
    double most = 0;
    for (const auto* part : {&shape.shift, &shape.shift90})
      for (const double x : *part) most = std::isfinite(x) ? std::max(most, std::abs(x)) : most;
    // A step in which nothing turns far: displacements are then linear in the shape.
    const double scale = most > 0 ? 1e-4 * std::min(1.0, extent > 0 ? extent : 1.0) / most : 0;
    if (scale == 0) continue;
    JsonObject json;
    json.text("name", shape.name).number("frequency", shape.frequency);
    Quantized numbers;
    for (const auto* part : {&shape.shift, &shape.shift90}) {
      if (part->empty()) continue;
      const std::vector<double> moved = displacements(*part, scale);
      for (std::size_t i = 0; i < 3; ++i) numbers.add(moved, i, 3);
    }
    json.raw("ranges", json_numbers(numbers.ranges, 9));
    json.number("piece", static_cast<double>(shape_pieces_.size()));
    shape_pieces_.push_back(compressed(split_bytes(numbers.steps)));
    all.push_back(json.done());
  }
  if (all.empty()) return;
  Quantized at_rest;
  for (std::size_t i = 0; i < 3; ++i) at_rest.add(base, i, 3);
  JsonObject group;
  group.raw("ranges", json_numbers(at_rest.ranges, 9)).raw("shapes", json_list(all));
  group.number("piece", static_cast<double>(shape_pieces_.size()));
  shape_pieces_.push_back(compressed(split_bytes(at_rest.steps)));
  shapes_ += (shapes_.empty() ? "" : ",") + group.done();
}

void Film::add_shape(JsonObject& scene, std::vector<std::string>& pieces) const {
  std::vector<std::string> bodies;
  bool coarse = false;
  for (const Drawn::Body& body : drawn_.bodies()) {
    JsonObject json;
    json.text("name", body.name).text("kind", body.kind).flag("rigid", body.rigid);
    bodies.push_back(json.number("first", body.first).number("count", body.count).done());
    coarse = coarse || body.coarse;
  }
  scene.raw("bodies", json_list(bodies)).flag("coarse", coarse);
  scene.raw("marks", marks_.json()).raw("ground", marks_.ground_json());
  std::vector<Index> numbers;
  for (const auto& triangle : drawn_.triangles()) numbers.insert(numbers.end(), triangle.begin(), triangle.end());
  for (const auto& edge : drawn_.edges()) numbers.insert(numbers.end(), edge.begin(), edge.end());
  for (const std::int64_t label : drawn_.labels()) numbers.push_back(static_cast<Index>(label));
  scene.number("triangles", static_cast<double>(drawn_.triangles().size()));
  scene.number("edges", static_cast<double>(drawn_.edges().size()));
  scene.number("points", static_cast<double>(drawn_.labels().size()));
  scene.number("lists", static_cast<double>(pieces.size()));
  pieces.push_back(compressed(bytes_of(numbers)));
  if (const std::vector<double> times = times_of_triangles(mechanism_, drawn_); !times.empty()) {
    scene.number("seen", static_cast<double>(pieces.size()));
    pieces.push_back(compressed(bytes_of(times)));
  }
  scene.number("local", static_cast<double>(pieces.size()));
  pieces.push_back(compressed(bytes_of(drawn_.local())));
}

// Small frames share a piece.
void Film::add_frames(JsonObject& scene, std::vector<std::string>& pieces) const {
  std::vector<std::string> frames;
  std::string together;
  std::size_t in_piece = 0;
  const auto close = [&] {
    if (in_piece == 0) return;
    pieces.push_back(compressed(together));
    together.clear();
    in_piece = 0;
  };
  for (const Frame& frame : frames_) {
    if (!frame.packed.empty()) close();
    JsonObject json;
    json.number("t", frame.t).number("piece", static_cast<double>(pieces.size()));
    json.number("place", static_cast<double>(in_piece)).raw("ranges", json_numbers(frame.numbers.ranges, 9));
    frames.push_back(json.done());
    if (!frame.packed.empty()) {
      pieces.push_back(frame.packed);
      continue;
    }
    together += split_bytes(frame.numbers.steps);
    ++in_piece;
    if (together.size() > 2 * kLarge) close();
  }
  close();
  scene.raw("frames", json_list(frames)).flag("fewer", fewer_);
}

std::vector<SimulationExtreme> Film::peaks() {
  background_.wait();
  std::vector<const Frame*> best;  // of each solid
  for (const Frame& frame : frames_) {
    best.resize(std::max(best.size(), frame.peaks.size()), nullptr);
    for (std::size_t k = 0; k < frame.peaks.size(); ++k)
      if (frame.peaks[k].found && (best[k] == nullptr || frame.peaks[k].value > best[k]->peaks[k].value))
        best[k] = &frame;
  }
  std::vector<SimulationExtreme> all;
  for (std::size_t k = 0; k < best.size(); ++k)
    if (best[k] != nullptr) all.push_back(stress_.describe(k, best[k]->peaks[k], best[k]->t));
  return all;
}

Film::Content Film::content() {
  background_.wait();
  Content out;
  JsonObject scene;
  add_shape(scene, out.pieces);
  std::vector<std::string> lengths;
  for (const Section& section : sections())
    lengths.push_back(fmt::format("[{},{}]", json_text(section.name), section.count));
  scene.raw("sections", json_list(lengths));
  scene.number("rest", static_cast<double>(out.pieces.size())).raw("rest_ranges", json_numbers(rest_.ranges, 9));
  out.pieces.push_back(compressed(split_bytes(rest_.steps)));
  add_frames(scene, out.pieces);
  scene.number("shapes_from", static_cast<double>(out.pieces.size())).raw("swings", "[" + shapes_ + "]");
  out.pieces.insert(out.pieces.end(), shape_pieces_.begin(), shape_pieces_.end());
  for (std::string& piece : out.pieces) piece = base64(piece);
  out.scene = scene.done();
  return out;
}

}  // namespace espalier::dynamics::page
