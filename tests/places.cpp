#include "places.hpp"

namespace espalier::test {

std::filesystem::path source_folder() { return ESPALIER_SOURCE; }

std::filesystem::path shared_data() { return source_folder() / "../shared/data"; }

}  // namespace espalier::test
