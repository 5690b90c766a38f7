from urmpipe_models.networks.network import Network


def refuse_faults(network):
    pass
