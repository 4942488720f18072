// The history of a seeker: rows as they were told, back from its columns bit for bit, refused as a whole.
#include "mgdd/optimize/ask_tell/seeker_history.hpp"

#include <gtest/gtest.h>

#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

RecordedSeeker<Spsa> two_inputs() {
  SpsaSettings settings;
  settings.space = space_at(inputs({8.0, -6.0}), 20.0);
  settings.seed = 4;
  return RecordedSeeker<Spsa>(Spsa(settings));
}

TEST(SeekerHistory, RoomThatWasMadeIsNotAllocatedAgain) {
  RecordedSeeker<Spsa> seeker = two_inputs();
  seeker.history().make_room(200);
  const double j[] = {1.0};
  const test_support::AllocationCounter counter;
  for (int k = 0; k < 200; ++k) {
    seeker.ask();
    seeker.tell({j, {}, false});
  }
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace mgdd::optimize
