#include "hal/core/errno_text.h"

#include <gtest/gtest.h>

#include <cerrno>

namespace haustra {
namespace {

TEST(ErrnoText, IsThatOfTheSystem) {
  EXPECT_EQ(ErrnoText(ENOENT), "No such file or directory");
  EXPECT_EQ(ErrnoText(EACCES), "Permission denied");
}

TEST(ErrnoText, OfNoErrorOfTheSystemIsTextToo) { EXPECT_NE(ErrnoText(123456), ""); }

}  // namespace
}  // namespace haustra
