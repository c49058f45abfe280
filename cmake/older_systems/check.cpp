// Does symbols.c link here? CMake tries it.
#include <cmath>
#include <condition_variable>
#include <mutex>

int main(int count, char**) {
  std::mutex mutex;
  std::condition_variable condition;
  std::unique_lock<std::mutex> lock(mutex);
  if (count > 1) condition.wait(lock);
  return std::hypot(static_cast<double>(count), 0.0) > 0 ? 0 : 1;
}
