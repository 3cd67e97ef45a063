#include "hamelin/model/robot.hpp"
