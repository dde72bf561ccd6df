// Runs body(i, worker) for i of [0, count) on num_threads threads; returns when all are done. Which thread takes which
// i is not determined, so bodies must not depend on it beyond their scratch memory, indexed by worker of [0,
// num_threads).
#pragma once

#include <atomic>
#include <thread>
#include <vector>

namespace haustra {

template <typename Body>
void ParallelFor(int count, int num_threads, Body&& body) {
  std::atomic<int> next{0};
  const auto work = [&](int worker) {
    for (int i = next.fetch_add(1); i < count; i = next.fetch_add(1)) body(i, worker);
  };
  std::vector<std::thread> threads;
  for (int worker = 1; worker < num_threads; ++worker) threads.emplace_back(work, worker);
  work(0);
  for (std::thread& thread : threads) thread.join();
}

}  // namespace haustra
