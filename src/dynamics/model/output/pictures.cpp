#include "dynamics/model/output/pictures.hpp"

#include <cmath>
#include <filesystem>

#include "dynamics/output/hdf5_file.hpp"

namespace espalier::dynamics::model {

namespace {

std::string file_of(const std::string& folder, const std::string& name, PictureFormat format) {
  if (format == PictureFormat::vtu) return folder + "/" + name + ".pvd";
  return folder + "/" + (name == "motion" ? "results" : name) + ".vtkhdf";
}

/// Pictures of an earlier run, in the format that this one has not.
void remove_others(const std::string& folder, const std::string& name, PictureFormat format) {
  std::error_code ignored;
  const std::string series = file_of(folder, name, PictureFormat::vtu);
  const std::string file = file_of(folder, name, PictureFormat::vtkhdf);
  if (format == PictureFormat::vtkhdf && PvdSeries(series).begin_anew()) std::filesystem::remove(series, ignored);
  if (format == PictureFormat::vtu && hdf5::is_own(file)) std::filesystem::remove(file, ignored);
}

/// The units of the model that was built, or empty.
std::string units_of(const Mechanism& mechanism) {
  for (const auto& [key, text] : mechanism.keys)
    if (key == "units" && text.size() > 2) return text.substr(1, text.size() - 2);  // between quotes
  return "";
}

}  // namespace

struct Pictures::Picture {
  double time = 0;
  std::vector<double> points, displacement, velocity, von_mises, failed, contact_pressure, quantities;
};

Pictures::Pictures(const std::string& folder, const std::string& name, PictureFormat format, const Mechanism& mechanism,
                   const State& initial, double keep_until, std::vector<std::string> quantities)
    : scene_(mechanism), path_(file_of(folder, name, format)) {
  scene_.place(initial);
  initial_ = scene_.points();
  if (std::isnan(keep_until)) remove_others(folder, name, format);
  if (format == PictureFormat::vtkhdf) {
    VtkHdfLayout layout{&scene_.cells(), initial_.size() / 3, scene_.body(), {}, {}, {{"von_mises", 1}}, {}};
    if (!scene_.failed(initial).empty()) layout.cell_fields.push_back({"failed", 1});
    for (const BuiltBody& body : mechanism.bodies) layout.body_names.push_back(body.spec.name);
    layout.point_fields = {{"displacement", 3}, {"velocity", 3}};
    if (!scene_.contact_pressure(initial).empty()) layout.point_fields.push_back({"contact_pressure", 1});
    layout.quantities = std::move(quantities);
    layout.units = units_of(mechanism);
    file_ = std::make_unique<VtkHdf>(path_, std::move(layout), keep_until);
    kept_ = file_->kept();
    return;
  }
  series_ = std::make_unique<PvdSeries>(path_);
  if (std::isnan(keep_until)) {
    series_->begin_anew();
  } else {
    kept_ = series_->resume(keep_until);
  }
  body_.assign(scene_.body().begin(), scene_.body().end());
}

void Pictures::write(const State& s, double time, std::vector<double> quantities) {
  scene_.place(s);
  auto picture = std::make_shared<Picture>();
  picture->time = time;
  picture->points = scene_.points();
  picture->velocity = scene_.velocity();
  picture->von_mises = scene_.von_mises(s);
  picture->failed = scene_.failed(s);
  picture->contact_pressure = scene_.contact_pressure(s);
  picture->displacement.resize(initial_.size());
  for (std::size_t i = 0; i < initial_.size(); ++i) picture->displacement[i] = picture->points[i] - initial_[i];
  picture->quantities = std::move(quantities);
  background_.enqueue([this, picture] { file_ ? write_frame(*picture) : write_vtu(*picture); });
}

void Pictures::write_frame(const Picture& picture) {
  VtkHdfFrame frame{
      picture.time, picture.points, {picture.displacement, picture.velocity}, {picture.von_mises}, picture.quantities};
  if (!picture.failed.empty()) frame.cell_fields.emplace_back(picture.failed);
  if (!picture.contact_pressure.empty()) frame.point_fields.emplace_back(picture.contact_pressure);
  file_->write(frame);
}

void Pictures::write_vtu(const Picture& picture) {
  std::vector<OutputField> point_fields = {{"displacement", 3, picture.displacement},
                                           {"velocity", 3, picture.velocity}};
  if (!picture.contact_pressure.empty()) point_fields.push_back({"contact_pressure", 1, picture.contact_pressure});
  std::vector<OutputField> cell_fields = {{"body", 1, body_}, {"von_mises", 1, picture.von_mises}};
  if (!picture.failed.empty()) cell_fields.push_back({"failed", 1, picture.failed});
  dynamics::write_vtu(series_->file_name(0), picture.points, scene_.cells(), point_fields, cell_fields);
  series_->add(picture.time, 0);
}

void Pictures::catch_up() {
  background_.wait();
  if (file_) file_->catch_up();
}

void Pictures::finish() {
  background_.wait();
  if (file_) return file_->finish();
  series_->finish();
}

}  // namespace espalier::dynamics::model
