#include "tools/view/request_gate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <set>

#include "tests/tools/evaluate/text_folder.h"

namespace haustra::view {
namespace {

using ::testing::HasSubstr;

constexpr const char* kToken = "0123456789abcdef0123456789abcdef";

RequestHead Good() { return {"GET", "/0123456789abcdef0123456789abcdef/run.json", "127.0.0.1:8000", {}, {}}; }

TEST(RequestGate, TheRightAddressIsAdmittedUnderItsNames) {
  const RequestGate gate(kToken, 8000);
  EXPECT_EQ(gate.Admit(Good()), "run.json");
  RequestHead head = Good();
  head.path = "/0123456789abcdef0123456789abcdef/";
  EXPECT_EQ(gate.Admit(head), "");
  head.host = "localhost:8000";
  head.origin = "http://localhost:8000";
  head.fetch_site = "same-origin";
  EXPECT_EQ(gate.Admit(head), "");
  head.fetch_site = "none";
  EXPECT_EQ(gate.Admit(head), "");
}

TEST(RequestGate, AnotherTokenIsRefused) {
  const RequestGate gate(kToken, 8000);
  for (const char* path : {"", "/", "/run.json", "/0123456789abcdef0123456789abcdef", "//run.json",
                           "/0123456789abcdef0123456789abcdee/run.json", "/0123456789abcdef0123456789abcdef0/run.json",
                           "/0123456789ABCDEF0123456789ABCDEF/", "x0123456789abcdef0123456789abcdef/run.json"}) {
    RequestHead head = Good();
    head.path = path;
    EXPECT_FALSE(gate.Admit(head)) << path;
  }
}

TEST(RequestGate, AnotherNameOfThisMachineIsRefused) {
  const RequestGate gate(kToken, 8000);
  for (const char* host : {"", "127.0.0.1", "localhost", "127.0.0.1:8001", "evil.example:8000",
                           "127.0.0.1:8000.example", "127.0.0.1:8000@evil.example", "[::1]:8000", "0.0.0.0:8000"}) {
    RequestHead head = Good();
    head.host = host;
    EXPECT_FALSE(gate.Admit(head)) << host;
  }
}

TEST(RequestGate, PagesFromElsewhereAreRefused) {
  const RequestGate gate(kToken, 8000);
  for (const char* origin : {"", "null", "http://evil.example", "https://127.0.0.1:8000", "http://127.0.0.1:8001",
                             "http://localhost:8000", "http://127.0.0.1:8000/"}) {
    RequestHead head = Good();
    head.origin = origin;
    EXPECT_FALSE(gate.Admit(head)) << origin;
  }
  for (const char* site : {"", "cross-site", "same-site"}) {
    RequestHead head = Good();
    head.fetch_site = site;
    EXPECT_FALSE(gate.Admit(head)) << site;
  }
}

// A form of another page would name that page's origin, or none.
TEST(RequestGate, ARequestToChangeSomethingNamesThePagesOrigin) {
  const RequestGate gate(kToken, 8000);
  RequestHead head = Good();
  head.method = "POST";
  EXPECT_FALSE(gate.Admit(head));
  head.origin = "http://127.0.0.1:8000";
  EXPECT_EQ(gate.Admit(head), "run.json");
  for (const char* origin : {"", "null", "http://evil.example", "http://localhost:8000"}) {
    head.origin = origin;
    EXPECT_FALSE(gate.Admit(head)) << origin;
  }
}

TEST(RequestGate, OtherMethodsAreRefused) {
  const RequestGate gate(kToken, 8000);
  for (const char* method : {"PUT", "DELETE", "OPTIONS", "HEAD", "get", ""}) {
    RequestHead head = Good();
    head.method = method;
    EXPECT_FALSE(gate.Admit(head)) << method;
  }
}

TEST(RequestToken, IsNewEachTime) {
  std::set<std::string> tokens;
  for (int i = 0; i < 50; ++i) {
    const Result<std::string> token = MakeToken();
    ASSERT_TRUE(token.ok());
    EXPECT_EQ(token->size(), 32u);
    EXPECT_EQ(token->find_first_not_of("0123456789abcdef"), std::string::npos);
    tokens.insert(*token);
  }
  EXPECT_EQ(tokens.size(), 50u);
}

TEST(RequestToken, AFileIsTakenThatOnlyItsOwnerReads) {
  const evaluate::TextFolder folder;
  folder.Write("token", std::string(kToken) + "\n");
  const std::string path = folder.At("token");
  ASSERT_EQ(::chmod(path.c_str(), 0640), 0);
  EXPECT_EQ(ReadToken(path).code(), StatusCode::kFailedPrecondition);
  ASSERT_EQ(::chmod(path.c_str(), 0600), 0);
  const Result<std::string> token = ReadToken(path);
  ASSERT_TRUE(token.ok()) << token.status().message();
  EXPECT_EQ(*token, kToken);
  EXPECT_EQ(ReadToken(folder.At("none")).code(), StatusCode::kNotFound);
}

TEST(RequestToken, AFileThatHoldsSomethingElseIsNamed) {
  const evaluate::TextFolder folder;
  for (const std::string& text : {std::string(), std::string("short"), std::string(129, 'a'),
                                  std::string(kToken) + "/..", std::string(kToken) + " " + kToken}) {
    folder.Write("token", text);
    ASSERT_EQ(::chmod(folder.At("token").c_str(), 0600), 0);
    const Result<std::string> token = ReadToken(folder.At("token"));
    EXPECT_EQ(token.code(), StatusCode::kInvalidArgument) << text;
    EXPECT_THAT(token.status().message(), HasSubstr("token: a token is 32 to 128"));
  }
}

}  // namespace
}  // namespace haustra::view
