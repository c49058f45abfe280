// Preloaded: a program in the language of the environment, as Qt, GTK and Python's locale module set it.
#include <locale>

namespace {

[[maybe_unused]] const std::locale before = std::locale::global(std::locale(""));

}  // namespace
