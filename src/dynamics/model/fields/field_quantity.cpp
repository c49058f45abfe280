#include "dynamics/model/fields/field_quantity.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "base/at.hpp"
#include "base/parallel.hpp"

namespace espalier::dynamics::model {
namespace {

constexpr std::size_t kNumbers = std::tuple_size_v<SiteNumbers>;

/// Axes of a shell at a sample point, as rows: the mesh's x axis laid into the shell (its z axis where x stands nearly
/// across), the one across that in the shell, the normal.
Mat3 shell_axes(const SampledBody& body, Index e, const double* xi) {
  constexpr double kAcross = 1e-3;
  const std::vector<double> x = body.reference(e);
  double dn[24];
  shape_gradients(ElementType::hex8, xi, dn);
  Vec3 along = Vec3::Zero(), across = Vec3::Zero();
  for (std::size_t a = 0; a < 8; ++a) {
    along += dn[a] * Eigen::Map<const Vec3>(&x[3 * a]);
    across += dn[8 + a] * Eigen::Map<const Vec3>(&x[3 * a]);
  }
  Mat3 axes;
  const Vec3 normal = along.cross(across).normalized();
  Vec3 first = Vec3::UnitX() - normal.x() * normal;
  if (first.norm() < kAcross) first = Vec3::UnitZ() - normal.z() * normal;
  first.normalize();
  axes << first.transpose(), normal.cross(first).transpose(), normal.transpose();
  return axes;
}

}  // namespace

FieldQuantity::FieldQuantity(std::shared_ptr<const SampledBody> body, std::shared_ptr<const Sites> sites,
                             FieldKind kind, Measure measure, Statistic statistic, base::ThreadPool* pool)
    : body_(std::move(body)),
      sites_(std::move(sites)),
      kind_(kind),
      measure_(std::move(measure)),
      statistic_(statistic),
      pool_(pool) {
  for (const Site& site : sites_->list)
    for (const SiteTerm& term : site.terms) needed_.push_back(term.element);
  sort_unique(needed_);
  all_ = 4 * needed_.size() > at(body_->elements());
  if (all_) {
    needed_.resize(at(body_->elements()));
    std::iota(needed_.begin(), needed_.end(), 0);
  }
}

std::shared_ptr<const FieldTable> FieldQuantity::table(const Sample& s) const {
  if (!all_) return std::make_shared<FieldTable>(body_->sample(*s.state, needed_, pool_));
  for (const auto& [known, found] : s.fields)
    if (known == &body_->body()) return found;
  return s.fields.emplace_back(&body_->body(), std::make_shared<FieldTable>(body_->sample(*s.state, needed_, pool_)))
      .second;
}

void FieldQuantity::add_term(const SiteTerm& term, const FieldTable& table, std::size_t row, SiteNumbers& to) const {
  const auto points = points_of(body_->points(term.element));
  const bool line = table.stress.empty();
  for (std::size_t q = 0; q < points.size(); ++q) {
    const double weight = term.factor * (*term.weights)[q];
    if (line || kind_ == FieldKind::strain) {
      const double* value = table.strain[row].value[q];
      for (std::size_t m = 0; m < 6; ++m) to[m] += weight * (line || m < 3 ? 1 : 0.5) * value[m];
      continue;
    }
    const double* value = table.stress[row].value[q];
    if (kind_ == FieldKind::stress) {
      for (std::size_t m = 0; m < 6; ++m) to[m] += weight * value[m];
      continue;
    }
    const Mat3 axes = shell_axes(*body_, term.element, points[q].xi.data());
    Mat3 s;
    s << value[0], value[3], value[5], value[3], value[1], value[4], value[5], value[4], value[2];
    s = (axes * s * axes.transpose()).eval();
    const double h = body_->thickness(), force = weight * h;
    const double moment = term.factor * (*term.slope)[q] * h * h / 12;
    const double in_plane[3] = {s(0, 0), s(1, 1), s(0, 1)};
    for (std::size_t k = 0; k < 3; ++k) {
      to[k] += force * in_plane[k];
      to[3 + k] += moment * in_plane[k];
    }
    to[6] += force * s(0, 2);
    to[7] += force * s(1, 2);
  }
}

std::vector<SiteNumbers> FieldQuantity::site_numbers(const Sample& s) const {
  const std::shared_ptr<const FieldTable> samples = table(s);
  std::vector<SiteNumbers> out(sites_->list.size(), SiteNumbers{});
  const std::span<const char> failed = body_->body().flexible->assembly().failed();
  const auto sum = [&](std::int64_t begin, std::int64_t end) {
    for (auto k = at(begin); k < at(end); ++k) {
      double whole = 0, all = 0;  // of the factors: those of elements that have not failed
      for (const SiteTerm& term : sites_->list[k].terms) {
        all += term.factor;
        if (!failed.empty() && failed[at(term.element)] != 0) continue;
        whole += term.factor;
        const auto row = all_ ? at(term.element)
                              : static_cast<std::size_t>(
                                    std::lower_bound(needed_.begin(), needed_.end(), term.element) - needed_.begin());
        add_term(term, *samples, row, out[k]);
      }
      if (whole != all && whole != 0)  // the mean of what is left
        for (double& x : out[k]) x *= all / whole;
    }
  };
  constexpr std::int64_t kSites = 256;
  base::for_each_range(out.size() > 2 * kSites ? pool_ : nullptr, static_cast<std::int64_t>(out.size()), kSites, sum);
  return out;
}

FieldQuantity::Peak FieldQuantity::peak(const Sample& s) const {
  const std::vector<SiteNumbers> numbers = site_numbers(s);
  Peak best;
  double mean = 0;
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    const Site& site = sites_->list[k];
    double x = measure_.value(numbers[k], site);
    if (statistic_ == Statistic::none || std::isnan(x)) return {x, &site};
    if (statistic_ == Statistic::maxabs) x = std::abs(x);
    const bool better = statistic_ == Statistic::min ? x < best.value : x > best.value;
    if (best.site == nullptr || better) best = {x, &site};
    mean += site.weight * x;
  }
  return statistic_ == Statistic::mean ? Peak{mean, nullptr} : best;
}

std::vector<double> FieldQuantity::values(const Sample& s) const {
  const std::vector<SiteNumbers> numbers = site_numbers(s);
  std::vector<double> out;
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    const Site& site = sites_->list[k];
    out.push_back(site.terms.empty() ? std::numeric_limits<double>::quiet_NaN() : measure_.value(numbers[k], site));
  }
  return out;
}

bool FieldQuantity::is_linear() const {
  return measure_.linear && (statistic_ == Statistic::none || statistic_ == Statistic::mean);
}

std::vector<double> FieldQuantity::numbers(const Sample& s) const {
  std::vector<double> out;
  for (const SiteNumbers& n : site_numbers(s)) out.insert(out.end(), n.begin(), n.end());
  return out;
}

// The largest value of sign * measure over a period.
double FieldQuantity::over_period(const SiteNumbers& re, const SiteNumbers& im, const Site& site, double sign) const {
  const auto combined = [&](double a, double b) {
    SiteNumbers n;
    for (std::size_t i = 0; i < kNumbers; ++i) n[i] = a * re[i] + b * im[i];
    return sign * measure_.value(n, site);
  };
  if (measure_.linear) return std::hypot(combined(1, 0), combined(0, 1));
  if (measure_.quadratic && sign > 0) {
    // q(re cos - im sin) = a cos^2 + b sin^2 - 2 c sin cos
    const double a = std::pow(combined(1, 0), 2), b = std::pow(combined(0, 1), 2);
    const double c = 0.5 * (std::pow(combined(1, 1), 2) - a - b);
    return std::sqrt(0.5 * (a + b) + std::hypot(0.5 * (a - b), c));
  }
  constexpr int kPhases = 48;
  const double step = 2 * std::numbers::pi / kPhases, golden = 0.5 * (std::sqrt(5.0) - 1);
  const auto at_phase = [&](double phase) { return combined(std::cos(phase), -std::sin(phase)); };
  double best = 0, most = -std::numeric_limits<double>::infinity();
  for (int k = 0; k < kPhases; ++k)
    if (const double x = at_phase(k * step); x > most) {
      most = x;
      best = k * step;
    }
  double low = best - step, high = best + step;
  for (int k = 0; k < 40; ++k) {
    const double inner = high - golden * (high - low), outer = low + golden * (high - low);
    const double x = at_phase(inner), y = at_phase(outer);
    most = std::max({most, x, y});
    (x > y ? high : low) = x > y ? outer : inner;
  }
  return most;
}

std::complex<double> FieldQuantity::amplitude(std::span<const std::complex<double>> numbers) const {
  std::complex<double> mean = 0;
  double most = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < sites_->list.size(); ++k) {
    const Site& site = sites_->list[k];
    SiteNumbers re, im;
    for (std::size_t i = 0; i < kNumbers; ++i) {
      re[i] = numbers[k * kNumbers + i].real();
      im[i] = numbers[k * kNumbers + i].imag();
    }
    const double weight = statistic_ == Statistic::none ? 1 : site.weight;
    if (is_linear()) {
      mean += weight * std::complex<double>(measure_.value(re, site), measure_.value(im, site));
    } else if (statistic_ == Statistic::none || statistic_ == Statistic::mean) {
      mean += weight * over_period(re, im, site, 1);
    } else {
      const bool low = statistic_ == Statistic::min;
      most = std::max(most, over_period(re, im, site, low ? -1 : 1));
      if (statistic_ == Statistic::maxabs) most = std::max(most, over_period(re, im, site, -1));
    }
  }
  if (is_linear() || statistic_ == Statistic::none || statistic_ == Statistic::mean) return mean;
  return statistic_ == Statistic::min ? -most : most;
}

}  // namespace espalier::dynamics::model
