/// \file
/// A number made of stresses, strains or forces in sections: at one place, or a statistic over several.
#pragma once

#include <complex>
#include <memory>
#include <span>

#include "dynamics/model/fields/measure.hpp"
#include "dynamics/model/output/quantities.hpp"

namespace espalier::dynamics::model {

enum class FieldKind { stress, strain, section };

class FieldQuantity {
 public:
  /// @param pool  may be null; outlives the object
  FieldQuantity(std::shared_ptr<const SampledBody> body, std::shared_ptr<const Sites> sites, FieldKind kind,
                Measure measure, Statistic statistic, base::ThreadPool* pool);

  [[nodiscard]] double value(const Sample& s) const { return peak(s).value; }

  // Small harmonic motions: the numbers at the sites are linear in them.
  /// Whether the quantity is, too.
  [[nodiscard]] bool is_linear() const;
  /// The numbers of all sites, one after the other.
  [[nodiscard]] std::vector<double> numbers(const Sample& s) const;
  /// From the complex amplitudes of numbers(): that of the quantity where it is linear; else its largest value over a
  /// period of the part that swings, as a real number (`min`: the least).
  [[nodiscard]] std::complex<double> amplitude(std::span<const std::complex<double>> numbers) const;

  /// At each site; NaN at those without terms.
  [[nodiscard]] std::vector<double> values(const Sample& s) const;

  struct Peak {
    double value = 0;
    const Site* site = nullptr;
  };
  /// value(), and the site that has it; null where it is a mean.
  [[nodiscard]] Peak peak(const Sample& s) const;
  [[nodiscard]] const SampledBody& body() const { return *body_; }

 private:
  [[nodiscard]] std::vector<SiteNumbers> site_numbers(const Sample& s) const;
  [[nodiscard]] std::shared_ptr<const FieldTable> table(const Sample& s) const;
  [[nodiscard]] double over_period(const SiteNumbers& re, const SiteNumbers& im, const Site& site, double sign) const;
  void add_term(const SiteTerm& term, const FieldTable& table, std::size_t row, SiteNumbers& to) const;

  std::shared_ptr<const SampledBody> body_;
  std::shared_ptr<const Sites> sites_;
  FieldKind kind_;
  Measure measure_;
  Statistic statistic_;
  base::ThreadPool* pool_;
  std::vector<Index> needed_;  // elements, rising
  bool all_ = false;           // most of them: the table of the whole body serves
};

}  // namespace espalier::dynamics::model
