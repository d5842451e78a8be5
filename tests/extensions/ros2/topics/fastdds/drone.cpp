// A drone on ROS 2 topics by Fast DDS, ROS 2's default middleware: takes cmd_vel (Twist, body frame)
// and enable, publishes odometry and a raw picture, and prints what it hears on odometry and
// picture topics of others. Usage: drone DOMAIN PREFIX; it ends with its standard input.
// It talks on loopback alone, without multicast.

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <unistd.h>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

#include "witnessPubSubTypes.h"

using namespace eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

static std::mutex mutex;
static geometry_msgs::msg::dds_::Twist_ asked;
static bool enabled = false;

template <typename T>
class Reader : public DataReaderListener {
public:
    explicit Reader(void (*take)(const T &)) : take_(take) {}
    void on_data_available(DataReader *reader) override {
        T message;
        SampleInfo info;
        while (reader->take_next_sample(&message, &info) == ReturnCode_t::RETCODE_OK) {
            if (info.valid_data) take_(message);
        }
    }

private:
    void (*take_)(const T &);
};

class Node {
public:
    Node(int domain, std::string prefix) : prefix_(std::move(prefix)) {
        DomainParticipantQos qos;
        auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
        udp->interfaceWhiteList.push_back("127.0.0.1");
        qos.transport().use_builtin_transports = false;
        qos.transport().user_transports.push_back(udp);
        rtps::Locator_t loopback;
        rtps::IPLocator::setIPv4(loopback, 127, 0, 0, 1);
        qos.wire_protocol().builtin.metatrafficUnicastLocatorList.push_back(loopback);
        qos.wire_protocol().builtin.initialPeersList.push_back(loopback);
        participant_ = DomainParticipantFactory::get_instance()->create_participant(domain, qos);
        if (participant_ == nullptr) std::exit(2);
        publisher_ = participant_->create_publisher(PUBLISHER_QOS_DEFAULT);
        subscriber_ = participant_->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
    }

    template <typename Support>
    DataWriter *writer(const std::string &name, bool reliable) {
        DataWriterQos qos;
        qos.reliability().kind = reliable ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
        qos.publish_mode().kind = ASYNCHRONOUS_PUBLISH_MODE;
        return publisher_->create_datawriter(topic<Support>(name), qos);
    }

    template <typename Support, typename T>
    void read(const std::string &name, bool reliable, void (*take)(const T &)) {
        DataReaderQos qos;
        qos.reliability().kind = reliable ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
        subscriber_->create_datareader(topic<Support>(name), qos, new Reader<T>(take));
    }

private:
    template <typename Support>
    Topic *topic(const std::string &name) {
        TypeSupport type(new Support());
        type.register_type(participant_);
        return participant_->create_topic(
            "rt" + prefix_ + name, type.get_type_name(), TOPIC_QOS_DEFAULT);
    }

    std::string prefix_;
    DomainParticipant *participant_;
    Publisher *publisher_;
    Subscriber *subscriber_;
};

static void say_odometry(const nav_msgs::msg::dds_::Odometry_ &heard) {
    const auto &place = heard.pose().pose().position();
    const auto &speed = heard.twist().twist().linear();
    std::printf("odometry %s %s %d.%09u %.6f %.6f %.6f %.6f %.6f %.6f\n",
                heard.header().frame_id().c_str(), heard.child_frame_id().c_str(),
                heard.header().stamp().sec(), heard.header().stamp().nanosec(), place.x(),
                place.y(), place.z(), speed.x(), speed.y(), speed.z());
    std::fflush(stdout);
}

template <typename Bytes>
static unsigned long sum(const Bytes &bytes) {
    unsigned long total = 0;
    for (auto one : bytes) total += one;
    return total;
}

static void say_image(const sensor_msgs::msg::dds_::Image_ &heard) {
    std::printf("image %s %ux%u %s %zu %lu\n", heard.header().frame_id().c_str(), heard.width(),
                heard.height(), heard.encoding().c_str(), heard.data().size(), sum(heard.data()));
    std::fflush(stdout);
}

static void say_compressed(const sensor_msgs::msg::dds_::CompressedImage_ &heard) {
    std::printf("compressed %s %s %zu %lu\n", heard.header().frame_id().c_str(),
                heard.format().c_str(), heard.data().size(), sum(heard.data()));
    std::fflush(stdout);
}

static void take_twist(const geometry_msgs::msg::dds_::Twist_ &heard) {
    std::lock_guard<std::mutex> lock(mutex);
    asked = heard;
}

static void take_enable(const std_msgs::msg::dds_::Bool_ &heard) {
    std::lock_guard<std::mutex> lock(mutex);
    enabled = heard.data();
    std::printf("enable %d\n", enabled);
    std::fflush(stdout);
}

int main(int count, char **words) {
    if (count != 3) return 2;
    Node node(std::atoi(words[1]), words[2]);
    auto *odometry = node.writer<nav_msgs::msg::dds_::Odometry_PubSubType>("/odometry", true);
    auto *image = node.writer<sensor_msgs::msg::dds_::Image_PubSubType>("/image", false);
    node.read<geometry_msgs::msg::dds_::Twist_PubSubType>("/cmd_vel", true, take_twist);
    node.read<std_msgs::msg::dds_::Bool_PubSubType>("/enable", true, take_enable);
    node.read<nav_msgs::msg::dds_::Odometry_PubSubType>("/heard/odometry", true, say_odometry);
    node.read<sensor_msgs::msg::dds_::Image_PubSubType>("/heard/image", true, say_image);
    node.read<sensor_msgs::msg::dds_::CompressedImage_PubSubType>(
        "/heard/image/compressed", true, say_compressed);

    // Its input's end is its own.
    std::thread([] {
        char byte;
        while (read(STDIN_FILENO, &byte, 1) > 0) {}
        std::_Exit(0);
    }).detach();

    const double step = 0.02;
    double x = 0, y = 0, z = 0, yaw = 0;
    for (long turn = 0;; ++turn) {
        std::this_thread::sleep_for(std::chrono::duration<double>(step));
        geometry_msgs::msg::dds_::Twist_ twist;
        {
            std::lock_guard<std::mutex> lock(mutex);
            if (enabled) twist = asked;
        }
        const double cos = std::cos(yaw), sin = std::sin(yaw);
        x += step * (cos * twist.linear().x() - sin * twist.linear().y());
        y += step * (sin * twist.linear().x() + cos * twist.linear().y());
        z = std::fmax(0.0, z + step * twist.linear().z());
        yaw += step * twist.angular().z();

        nav_msgs::msg::dds_::Odometry_ told;
        told.header().stamp().sec(static_cast<int32_t>(turn / 50 + 1));
        told.header().stamp().nanosec(static_cast<uint32_t>(turn % 50) * 20000000u);
        told.header().frame_id("x3/odom");
        told.child_frame_id("x3/base_footprint");
        told.pose().pose().position().x(x);
        told.pose().pose().position().y(y);
        told.pose().pose().position().z(z);
        told.pose().pose().orientation().z(std::sin(yaw / 2));
        told.pose().pose().orientation().w(std::cos(yaw / 2));
        told.twist().twist(twist);
        odometry->write(&told);

        if (turn % 5 == 0) {
            sensor_msgs::msg::dds_::Image_ picture;
            picture.header() = told.header();
            picture.width(640);
            picture.height(480);
            picture.encoding("rgb8");
            picture.step(640 * 3);
            picture.data().resize(640 * 480 * 3);
            for (size_t index = 0; index < picture.data().size(); ++index) {
                picture.data()[index] = static_cast<uint8_t>(index % 251);
            }
            image->write(&picture);
        }
    }
}
