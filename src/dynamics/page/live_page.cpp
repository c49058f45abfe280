#include "dynamics/page/live_page.hpp"

#include <algorithm>

#include "base/output_file.hpp"

namespace espalier::dynamics::page {
namespace {

constexpr std::chrono::seconds kFirst{2};
constexpr std::chrono::seconds kEvery{4};
constexpr int kShare = 50;  // of the time: writing takes at most one part

}  // namespace

LivePage::LivePage(const model::Mechanism& mechanism, const model::Description& model, const std::string& folder,
                   double begin, double end, double wished)
    : film_(mechanism, model, begin, end, wished),
      path_(folder.empty() ? "" : folder + "/index.html"),
      due_(Clock::now() + kFirst) {}

bool LivePage::step(const model::Sample& s) {
  film_.step(s);
  return due();
}

void LivePage::restore(const model::Sample& s) {
  film_.restore(s);
  rows_.restore(s.time());
}

void LivePage::write(const RunOfPage& run) {
  if (path_.empty()) return;
  const Clock::time_point begin = Clock::now();
  due_ = Clock::time_point::max();  // one failure is enough
  base::OutputFile file(path_);
  write_page(run, rows_, film_, [&](std::string_view piece) { file.write(piece); });
  file.commit();
  written_ = path_;
  const Clock::time_point end = Clock::now();
  due_ = end + std::max<Clock::duration>(kEvery, kShare * (end - begin));
}

std::string LivePage::text(const RunOfPage& run, const Rows& others) {
  std::string page;
  write_page(run, rows_.empty() ? others : rows_, film_, [&](std::string_view piece) { page += piece; });
  return page;
}

}  // namespace espalier::dynamics::page
