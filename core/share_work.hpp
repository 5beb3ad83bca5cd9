// Work shared among threads.
#pragma once

namespace grainclock::core {

/// Calls work(t) for t from 0 to parts - 1, by as many threads.
template <class Work>
void share_work(int parts, Work work) {
  if (parts == 1) {
    work(0);
    return;
  }
#pragma omp parallel for num_threads(parts) schedule(static, 1)
  for (int t = 0; t < parts; ++t) work(t);
}

}  // namespace grainclock::core
