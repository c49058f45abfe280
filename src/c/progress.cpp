// The C interface: how far calls of a thread are.
#include "espalier/progress.hpp"

#include <memory>
#include <new>

#include "espalier/espalier.h"

namespace {

thread_local std::unique_ptr<espalier::ProgressListener> listener_of_thread;

}  // namespace

int espalier_listen(espalier_progress_callback tell, void* user) {
  try {
    listener_of_thread.reset();
    if (tell == nullptr) return ESPALIER_OK;
    listener_of_thread = std::make_unique<espalier::ProgressListener>([tell, user](const espalier::ProgressReport& r) {
      const espalier_progress c = {
          r.phase.c_str(), r.done,           r.total,       r.unit.c_str(), r.seconds,
          r.seconds_left,  r.inside.c_str(), r.inside_done, r.inside_total, r.inside_unit.c_str()};
      tell(&c, user);
    });
  } catch (const std::bad_alloc&) {
    return ESPALIER_OUT_OF_MEMORY;
  }
  return ESPALIER_OK;
}
