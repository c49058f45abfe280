#include "dynamics/model/pictures.hpp"

#include <array>
#include <cmath>
#include <memory>

namespace espalier::dynamics::model {

Pictures::Pictures(const std::string& path, const Mechanism& mechanism, const State& initial, double keep_until)
    : scene_(mechanism), series_(path) {
  if (std::isnan(keep_until)) {
    series_.begin_anew();
  } else {
    kept_ = series_.resume(keep_until);
  }
  body_.assign(scene_.body().begin(), scene_.body().end());
  scene_.place(initial);
  initial_ = scene_.points();
}

struct Pictures::Picture {
  std::vector<double> points, displacement, velocity, von_mises, contact_pressure;
};

void Pictures::write(const State& s, double time) {
  scene_.place(s);
  auto picture = std::make_shared<Picture>();
  picture->points = scene_.points();
  picture->velocity = scene_.velocity();
  picture->von_mises = scene_.von_mises(s);
  picture->contact_pressure = scene_.contact_pressure(s);
  picture->displacement.resize(initial_.size());
  for (std::size_t i = 0; i < initial_.size(); ++i) picture->displacement[i] = picture->points[i] - initial_[i];
  background_.enqueue([this, time, picture] {
    std::vector<OutputField> point_fields = {{"displacement", 3, picture->displacement},
                                             {"velocity", 3, picture->velocity}};
    if (!picture->contact_pressure.empty()) point_fields.push_back({"contact_pressure", 1, picture->contact_pressure});
    const std::array<OutputField, 2> cell_fields = {OutputField{"body", 1, body_},
                                                    OutputField{"von_mises", 1, picture->von_mises}};
    write_vtu(series_.file_name(0), picture->points, scene_.cells(), point_fields, cell_fields);
    series_.add(time, 0);
  });
}

void Pictures::finish() {
  catch_up();
  series_.finish();
}

}  // namespace espalier::dynamics::model
