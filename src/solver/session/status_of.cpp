#include "solver/session/status_of.hpp"

#include <fmt/format.h>

#include <new>
#include <stdexcept>
#include <system_error>

namespace espalier::solver {

Status status_of_function(base::Interruption& interruption, std::string_view remedy,
                          const std::function<void()>& body) {
  try {
    const base::Interruption::Call call(interruption);
    interruption.check();  // only this thread asks, and the others may leave it no piece of the work
    body();
    return {};
  } catch (const Error& e) {
    return e.status();
  } catch (const std::bad_alloc&) {
    return {StatusCode::out_of_memory, fmt::format("the machine refused memory; {}", remedy), -1};
  } catch (const std::length_error&) {
    return {StatusCode::out_of_memory, "an array longer than the machine can address was needed", -1};
  } catch (const std::system_error& e) {
    if (e.code() != std::errc::resource_unavailable_try_again) throw;
    return {StatusCode::out_of_memory, "the system refuses to start another thread; raise the limit (ulimit -u)", -1};
  }
}

}  // namespace espalier::solver
