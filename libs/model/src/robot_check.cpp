#include "hamelin/model/robot.hpp"
namespace hamelin::model { void check(const Robot&, const std::string&) {} }
