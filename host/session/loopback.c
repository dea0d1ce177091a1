/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/session/loopback.h"

#include <arpa/inet.h>
#include <dirent.h>
#include <linux/filter.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <netinet/in.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

enum { LCM_PORT = 7667 };

bool loopback_only(const char *url)
{
	const char *ttl = strstr(url, "ttl=");

	return ttl == NULL || strtol(ttl + strlen("ttl="), NULL, 10) <= 0;
}

/* The number behind the last colon before the options; that of "udpm:" is none. */
static unsigned port_of(const char *url)
{
	const char *place = strstr(url, "://");
	const char *colon = place == NULL ? NULL : strchr(place + 3, ':');
	const char *options = place == NULL ? NULL : strchr(place + 3, '?');

	if (colon == NULL || (options != NULL && colon > options))
		return LCM_PORT;
	return (unsigned)strtoul(colon + 1, NULL, 10);
}

static bool is_bound(int fd, unsigned port)
{
	struct sockaddr_in address;
	socklen_t length = sizeof(address);
	int type;
	socklen_t type_length = sizeof(type);

	memset(&address, 0, sizeof(address));
	return getsockopt(fd, SOL_SOCKET, SO_TYPE, &type, &type_length) == 0 && type == SOCK_DGRAM &&
	       getsockname(fd, (struct sockaddr *)&address, &length) == 0 && address.sin_family == AF_INET &&
	       ntohs(address.sin_port) == port;
}

static int session_loopback_confine(int fd)
{
	const uint32_t packet_type = (uint32_t)SKF_AD_OFF + SKF_AD_PKTTYPE,
	               interface = (uint32_t)SKF_AD_OFF + SKF_AD_IFINDEX;
	struct sock_filter program[] = {
	        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, packet_type),
	        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, PACKET_LOOPBACK, 2, 0),
	        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, interface),
	        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, if_nametoindex("lo"), 0, 1),
	        BPF_STMT(BPF_RET | BPF_K, UINT32_MAX), /* all of it */
	        BPF_STMT(BPF_RET | BPF_K, 0),
	};
	struct sock_fprog filter = {.len = sizeof(program) / sizeof(program[0]), .filter = program};

	return setsockopt(fd, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof(filter)) == 0 ? 0 : DT_E_SYSTEM;
}

int loopback_confine(const char *url)
{
	DIR *fds = opendir("/proc/self/fd");
	unsigned port = port_of(url);
	struct dirent *entry;
	bool found = false;
	int result = 0;

	if (fds == NULL)
		return DT_E_SYSTEM;
	while (result == 0 && (entry = readdir(fds)) != NULL) {
		int fd = (int)strtol(entry->d_name, NULL, 10);

		if (entry->d_name[0] == '.' || !is_bound(fd, port))
			continue;
		result = session_loopback_confine(fd);
		found = true;
	}
	closedir(fds);
	return result == 0 && !found ? DT_E_SYSTEM : result;
}
